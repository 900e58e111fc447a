"""Safety checks of a trial over a hostile link, from what truly happened and what the program reported.

The ground truth is the packets at the vehicle's antenna, its true height, who flew it, and the hazards that set in.
Times are in s since the drone was switched on.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.records.trajectory import Trajectory
from bench.hazards.cases import ABORT, FOR_GOOD_S, Case
from bench.hazards.hostile_table import HARMLESS, HAZARDS, LEADS, NOT_SEEN, PILOTS, PROCESS_KILLED, Expected
from bench.hazards.rig import InjectedFault, MotorStop
from bench.hazards.trial_states import LIFTED_M, RESTING_M, State, TrialStates
from bench.hazards.wire import Command

CEILING_M: Final = 5.5
"""Altitude limit plus one metre."""
RECORD_WITHIN_M: Final = 0.35
HOVERS_M: Final = 2.0
"""Height that a vehicle with a valid record must keep in the middle of the record."""
SET_POINT_M: Final = 3.0
SINKS_M_S: Final = -0.2
LAND_WITHIN_S: Final = 8.0
"""Longest time without Land for a vehicle that does not descend; Land is repeated every six seconds under Paparazzi."""
LAND_AFTER_DEATH_S: Final = 15.0
"""The same from the death of the process on, of which 3 s pass until another one has connected."""
LOST: Final = "lost"
"""Outcome of a trial whose process was killed."""
FELL_M_S: Final = 2.2
"""Speed of ground contact of a vehicle that certainly fell."""
SEEN_S: Final = 2.3
"""Largest time between the first and the second heartbeat of a pilot, with one heartbeat per second."""
QUIET: Final = frozenset({Command.HEARTBEAT, Command.REQUEST})
"""Commands that change nothing on the vehicle."""


@dataclass(frozen=True, slots=True)
class TrueState:
    """True state of the drone; `heard`: a packet of it has arrived within the last second."""

    time_s: float
    height_m: float
    climb_rate_m_s: float
    armed: bool
    heard: bool

    @property
    def flies(self) -> bool:
        return self.height_m > LIFTED_M


@dataclass(frozen=True, slots=True)
class ReportedOutcome:
    """Outcome of a trial and state of the vehicle (safe, quarantined, unopened) as reported by the program; of a trial
    whose process was killed, by the next process.

    `concern` is the program's concern about the vehicle at the end of the trial, `final_concern` that after attending
    to the vehicle.
    """

    outcome: str
    vehicle: str
    reason: str
    concern: str = ""
    final_concern: str = ""
    record: Trajectory | None = None
    failure: str = ""
    """Number of the failure in docs/real-flight.md; empty without one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundTruth:
    """What truly happened. `true_states` and `sent` continue until the attendance ends; `states` end with the trial."""

    case: Case
    states: TrialStates
    injected: Sequence[InjectedFault]
    sent: Sequence[tuple[float, Command]]
    stops: Sequence[MotorStop]
    true_states: Sequence[TrueState]
    armed: bool
    holds_safe: bool
    rose_m: float = 0.0
    """How far it has risen from where it stood."""
    impact_m_s: float = 0.0
    """Greatest speed near the ground, downwards."""
    pilot_seen_s: Sequence[float] = ()
    """Times of heartbeats that showed a pilot's mode, after the takeoff."""
    overruled_s: float = FOR_GOOD_S
    """When a command took the vehicle from that pilot."""

    @property
    def hazard(self) -> InjectedFault | None:
        """The hazard under test; None if its state was never reached."""
        return next((each for each in self.injected if each.kind == self.case.faults[0].kind), None)

    @property
    def expected(self) -> Expected:
        return HARMLESS if self.hazard is None else HAZARDS[self.hazard.kind].expected

    @property
    def after(self) -> list[TrueState]:
        """True states after the end of the trial."""
        return [each for each in self.true_states if each.time_s > self.states.ended_s]

    @property
    def rose(self) -> bool:
        return any(each.flies for each in self.true_states)

    @property
    def flies(self) -> bool:
        return bool(self.true_states) and self.true_states[-1].flies

    @property
    def may_be_in_hand(self) -> bool:
        """Whether two heartbeats have shown a pilot. From then on the program must leave the vehicle alone."""
        return len(self.pilot_seen_s) > 1 and self.overruled_s == FOR_GOOD_S

    def in_hand_since_s(self) -> float:
        """When at the latest the program must have detected the pilot."""
        seen_s = min(self.pilot_seen_s, default=FOR_GOOD_S) + SEEN_S
        flown = any(each.kind in PILOTS and each.ended_s > seen_s for each in self.injected)
        return seen_s if flown and self.overruled_s > seen_s else FOR_GOOD_S


def find_violations(truth: GroundTruth, reported: ReportedOutcome) -> tuple[str, ...]:
    """Return every violation; empty if there is none."""
    return (*_vehicle(truth, reported), *_commands(truth), *judge(truth, reported), *_record(truth, reported))


def _vehicle(truth: GroundTruth, reported: ReportedOutcome) -> Iterator[str]:
    stops = [stop.height_m for stop in truth.stops if stop.height_m > LIFTED_M]
    if stops:
        yield f"motors off was sent at {max(stops):.2f} m"
    stays = truth.case.autopilot in truth.expected.stays
    if truth.flies and not (truth.may_be_in_hand or stays):
        yield f"the vehicle was left at {truth.true_states[-1].height_m:.2f} m"
    if (highest_m := max((each.height_m for each in truth.true_states), default=0.0)) > CEILING_M:
        yield f"the vehicle rose to {highest_m:.2f} m"
    if reported.vehicle == "safe" and (truth.armed or not truth.holds_safe):
        yield f"reported as safe, but is {'armed' if truth.armed else 'not on its safe gains'}"
    was_heard = truth.hazard is None or truth.hazard.state is not State.LINK_LOST
    if reported.vehicle == "safe" and truth.impact_m_s > FELL_M_S and was_heard:
        yield f"reported as safe, but it hit the ground at {truth.impact_m_s:.1f} m/s"
    if reported.vehicle == "unopened":
        return
    over = truth.after[0] if truth.after else None
    if over is not None and (over.armed or over.flies) and not reported.concern and reported.outcome != LOST:
        yield "armed or in the air after its trial, but no concern was reported"
    if (truth.armed or truth.flies) and not reported.final_concern:
        yield "armed or in the air at the end, but no concern was reported"


def _commands(truth: GroundTruth) -> Iterator[str]:
    """Check that a vehicle in the air gets nothing but Land after its trial, and nothing while a pilot flies it."""
    in_hand_s, ended_s = truth.in_hand_since_s(), truth.states.ended_s
    heights = np.array([(each.time_s, each.height_m) for each in truth.true_states])
    for at_s, command in truth.sent if len(heights) else ():
        flies = np.interp(at_s, heights[:, 0], heights[:, 1]) > LIFTED_M
        if flies and command not in QUIET and at_s > in_hand_s:
            yield f"{command} was sent while a pilot flew the vehicle"
        elif flies and at_s > ended_s and command not in {*QUIET, Command.LAND}:
            yield f"{command} was sent in the air after the trial"
    if truth.overruled_s < FOR_GOOD_S and np.interp(truth.overruled_s, heights[:, 0], heights[:, 1]) > LIFTED_M:
        yield "the vehicle was taken from a pilot whom a heartbeat had shown"
    longest_s = 0.0 if truth.may_be_in_hand else max(_waits(truth), default=0.0)
    if longest_s > (LAND_AFTER_DEATH_S if truth.case.faults[0].kind == PROCESS_KILLED else LAND_WITHIN_S):
        yield f"the vehicle was left in the air for {longest_s:.0f} s without Land"


def _waits(truth: GroundTruth) -> Iterator[float]:
    """Yield the times since the last Land while the vehicle, armed and heard, did not descend, from its first Land or
    the end of its trial on."""
    lands = [at_s for at_s, command in truth.sent if command is Command.LAND]
    from_s = min([truth.states.ended_s, *lands])
    since_s: float | None = None
    for now in (each for each in truth.true_states if each.time_s > from_s):
        if not (now.armed and now.flies and now.heard and now.climb_rate_m_s > SINKS_M_S):
            since_s = None
            continue
        since_s = now.time_s if since_s is None else since_s
        landed_s = max((at_s for at_s in lands if at_s <= now.time_s), default=since_s)
        yield now.time_s - max(since_s, landed_s)


def judge(truth: GroundTruth, reported: ReportedOutcome) -> Iterator[str]:
    """Check the reported outcome and its failure against what happened."""
    kind, hazard, expected = truth.case.faults[0].kind, truth.hazard, truth.expected
    led = {each.kind for each in truth.injected if each.kind in LEADS}
    may_abort = ABORT in led or truth.case.autopilot in expected.aborts
    match reported.outcome:
        case "refused":
            if truth.rose or truth.rose_m > RESTING_M:
                yield f"reported as not flown, but it flew ({reported.reason})"
            if not (expected.refuses or led):
                yield f"refused for a reason that did not occur ({reported.reason})"
        case "completed":
            if ABORT in led:
                yield "reported as completed, but it was aborted"
            if truth.case.faults[0].duration_s == FOR_GOOD_S and hazard and hazard.state in expected.ends_in:
                yield f"reported as completed, although {kind} set in"
        case "aborted" | "invalid":
            yield from _failure(reported, {*expected.codes, *(LEADS[each] for each in led)})
            if reported.outcome == "aborted" and not may_abort:
                yield f"counted against the gains, but the cause was {kind} ({reported.reason})"
    if reported.vehicle == "quarantined" and not expected.quarantines:
        yield f"unnecessary quarantine ({reported.concern})"


def _failure(reported: ReportedOutcome, known: set[str]) -> Iterator[str]:
    is_known = reported.failure in known and (reported.failure != NOT_SEEN or reported.vehicle == "quarantined")
    if not is_known:
        yield f"{reported.outcome} as {reported.failure or 'no failure'}, which did not occur ({reported.reason})"


def _record(truth: GroundTruth, reported: ReportedOutcome) -> Iterator[str]:
    """Check that a valid record is complete and agrees with the true height while the vehicle hovers."""
    took_off_s, record = _took_off_s(truth), reported.record
    if reported.outcome != "completed" or record is None:
        return
    if took_off_s is None or not truth.rose:
        yield "a valid record without a flight"
        return
    if record.time_s[-1] < truth.states.recorded_s - 0.3:
        yield f"a valid record ends after {record.time_s[-1]:.1f} s"
    times_s, heights_m = (
        np.array(column) for column in zip(*((m.time_s, m.height_m) for m in truth.true_states), strict=True)
    )
    true_m = np.interp(record.time_s + took_off_s, times_s, heights_m)
    hovering = (record.time_s > 10.0) & (record.time_s < truth.states.recorded_s)
    if true_m[hovering].min() < HOVERS_M:
        yield f"a valid record, but the vehicle was at {true_m[hovering].min():.2f} m"
    if abs((stood_m := float(np.median(true_m[hovering]))) - SET_POINT_M) > RECORD_WITHIN_M:
        yield f"a valid record, but the vehicle hovered at {stood_m:.2f} m: its altitude has another zero"
    apart_m = np.abs(record["altitude_m"] - true_m - (record["altitude_m"][0] - true_m[0]))
    if apart_m[hovering].max() > RECORD_WITHIN_M:
        yield f"a valid record differs by {apart_m[hovering].max():.2f} m from the true height"


def _took_off_s(truth: GroundTruth) -> float | None:
    """Return when the takeoff command reached the vehicle."""
    return next((at_s for at_s, command in truth.sent if command is Command.TAKE_OFF), None)
