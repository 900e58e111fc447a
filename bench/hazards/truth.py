"""What nobody may ever see of a trial, held against what truly happened: the packets at the vehicle's antenna, where it
was, who flew it, and what befell it. Times in s since the drone was switched on.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.records.trajectory import Trajectory
from bench.hazards.cases import ABORT, FOR_GOOD_S, Case
from bench.hazards.expectations import EXPECTED, HARMLESS, LEADS
from bench.hazards.hostility import PILOTS
from bench.hazards.rig import Stopping, Struck
from bench.hazards.stages import LIFTED_M, RECORDED_S, Stages
from bench.hazards.wire import Order

CEILING_M: Final = 5.5
"""The limit of altitude, and a metre."""
RECORD_WITHIN_M: Final = 0.35
HOVERS_M: Final = 2.0
"""A vehicle that was below this over the middle of its record did not fly it."""
SINKS_M_S: Final = -0.2
LAND_WITHIN_S: Final = 8.0
"""A vehicle that does not sink is told to land as often: every six seconds under Paparazzi."""
SEEN_S: Final = 2.3
"""Two heartbeats that agree lie no further apart, where they come once a second."""
QUIET: Final = frozenset({Order.HEARTBEAT, Order.ASK})
"""What changes nothing on a vehicle."""


@dataclass(frozen=True, slots=True)
class Moment:
    """Where the drone truly was; `heard`: something of it had arrived within the last second."""

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
    """Reports of the program: on the finished trial, and on the vehicle (safe, quarantined, unopened), with its
    concern then and at last."""

    outcome: str
    vehicle: str
    reason: str
    concern: str = ""
    concern_at_last: str = ""
    record: Trajectory | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What happened. `moments` and `sent` go on to the end of the attendance, `stages` end with the trial."""

    case: Case
    stages: Stages
    struck: Sequence[Struck]
    sent: Sequence[tuple[float, Order]]
    stops: Sequence[Stopping]
    moments: Sequence[Moment]
    armed: bool
    holds_safe: bool
    pilot_told_s: Sequence[float] = ()
    """When heartbeats told of a pilot, from the take-off on."""
    overruled_s: float = FOR_GOOD_S
    """When the vehicle was taken from that pilot by an order."""

    @property
    def hazard(self) -> Struck | None:
        """The one that the case is about, if its state was ever reached."""
        return next((each for each in self.struck if each.kind == self.case.mishaps[0].kind), None)

    @property
    def after(self) -> list[Moment]:
        """The trial."""
        return [each for each in self.moments if each.time_s > self.stages.over_s]

    @property
    def rose(self) -> bool:
        return any(each.flies for each in self.moments)

    @property
    def flies(self) -> bool:
        return bool(self.moments) and self.moments[-1].flies

    @property
    def may_be_in_hand(self) -> bool:
        """Whether two heartbeats have told that a pilot flies it: then it is theirs, also when they switch back."""
        return len(self.pilot_told_s) > 1 and self.overruled_s == FOR_GOOD_S

    def in_hand_since_s(self) -> float:
        """From when on nobody can overlook them."""
        seen_s = min(self.pilot_told_s, default=FOR_GOOD_S) + SEEN_S
        flown = any(each.kind in PILOTS and each.ended_s > seen_s for each in self.struck)
        return seen_s if flown and self.overruled_s > seen_s else FOR_GOOD_S


def judge(truth: Truth, reported: ReportedOutcome) -> tuple[str, ...]:
    """Everything that may not be."""
    return (*_vehicle(truth, reported), *_orders(truth), *_verdict(truth, reported), *_record(truth, reported))


def _vehicle(truth: Truth, reported: ReportedOutcome) -> Iterator[str]:
    stops = [stop.height_m for stop in truth.stops if stop.height_m > LIFTED_M]
    if stops:
        yield f"its motors were told to stop at {max(stops):.2f} m"
    if truth.flies and not truth.may_be_in_hand:
        yield f"it was left at {truth.moments[-1].height_m:.2f} m"
    if (highest_m := max((each.height_m for each in truth.moments), default=0.0)) > CEILING_M:
        yield f"it rose to {highest_m:.2f} m"
    if reported.vehicle == "safe" and (truth.armed or not truth.holds_safe):
        yield f"it is said to be safe, and is {'armed' if truth.armed else 'not on its safe gains'}"
    if reported.vehicle == "unopened":
        return
    over = truth.after[0] if truth.after else None
    if over is not None and (over.armed or over.flies) and not reported.concern:
        yield "its trial is over, and nothing is said of one that is armed or flies"
    if (truth.armed or truth.flies) and not reported.concern_at_last:
        yield "at last nothing is said of one that is armed or flies"


def _orders(truth: Truth) -> Iterator[str]:
    """After its trial a vehicle in the air is told to land, and nothing else; one that a pilot flies, nothing."""
    in_hand_s, over_s = truth.in_hand_since_s(), truth.stages.over_s
    heights = np.array([(each.time_s, each.height_m) for each in truth.moments])
    for at_s, order in truth.sent if len(heights) else ():
        flies = np.interp(at_s, heights[:, 0], heights[:, 1]) > LIFTED_M
        if flies and order not in QUIET and at_s > in_hand_s:
            yield f"{order} was sent while a pilot flew it"
        elif flies and at_s > over_s and order not in {*QUIET, Order.LAND}:
            yield f"{order} was sent to it in the air after its trial"
    if truth.overruled_s < FOR_GOOD_S and np.interp(truth.overruled_s, heights[:, 0], heights[:, 1]) > LIFTED_M:
        yield "it was taken from a pilot whom a heartbeat had told of"
    longest_s = 0.0 if truth.may_be_in_hand else max(_waits(truth), default=0.0)
    if longest_s > LAND_WITHIN_S:
        yield f"it was left in the air for {longest_s:.0f} s without Land"


def _waits(truth: Truth) -> Iterator[float]:
    """How long it stayed up after its trial, armed, heard and in nobody's hands, since it was last told to land."""
    lands = [at_s for at_s, order in truth.sent if order is Order.LAND]
    since_s: float | None = None
    for now in truth.after:
        if not (now.armed and now.flies and now.heard and now.climb_rate_m_s > SINKS_M_S):
            since_s = None
            continue
        since_s = now.time_s if since_s is None else since_s
        told_s = max((at_s for at_s in lands if at_s <= now.time_s), default=since_s)
        yield now.time_s - max(since_s, told_s)


def _verdict(truth: Truth, reported: ReportedOutcome) -> Iterator[str]:
    """What is said of the trial is what happened, and names what befell it."""
    hazard = truth.hazard
    expected = HARMLESS if hazard is None else EXPECTED[hazard.kind]
    led = {each.kind for each in truth.struck if each.kind in LEADS}
    known = (*expected.told, *(LEADS[kind] for kind in led))
    if reported.outcome == "refused" and truth.rose:
        yield f"it is said not to have flown, and did ({reported.reason})"
    if reported.outcome == "completed":
        if ABORT in led:
            yield "its trial counts as completed, though it was aborted"
        if truth.case.mishaps[0].duration_s == FOR_GOOD_S and hazard is not None and hazard.stage in expected.ends:
            yield f"its trial counts as completed, though {truth.case.mishaps[0].kind} set in"
    elif not any(words in reported.reason for words in known):
        yield f"it is {reported.outcome} for what did not happen ({reported.reason})"
    if reported.outcome == "aborted" and ABORT not in led and not expected.aborts:
        yield f"its gains are blamed for {truth.case.mishaps[0].kind} ({reported.reason})"
    if reported.vehicle == "quarantined" and not expected.quarantines:
        yield f"it was quarantined without need ({reported.concern})"


def _record(truth: Truth, reported: ReportedOutcome) -> Iterator[str]:
    """A record that counts is whole, of a flight, and where the vehicle truly was: compared where it hovers."""
    took_off_s, record = _took_off_s(truth), reported.record
    if reported.outcome != "completed" or record is None:
        return
    if took_off_s is None or not truth.rose:
        yield "a record of a flight that never was"
        return
    if record.time_s[-1] < RECORDED_S - 0.3:
        yield f"its record counts, and ends after {record.time_s[-1]:.1f} s"
    times_s, heights_m = (
        np.array(column) for column in zip(*((m.time_s, m.height_m) for m in truth.moments), strict=True)
    )
    true_m = np.interp(record.time_s + took_off_s, times_s, heights_m)
    hovering = (record.time_s > 10.0) & (record.time_s < RECORDED_S)
    if true_m[hovering].min() < HOVERS_M:
        yield f"its record counts, and it was at {true_m[hovering].min():.2f} m"
    apart_m = np.abs(record["altitude_m"] - true_m - (record["altitude_m"][0] - true_m[0]))
    if apart_m[hovering].max() > RECORD_WITHIN_M:
        yield f"its record counts, and is {apart_m[hovering].max():.2f} m from where it was"


def _took_off_s(truth: Truth) -> float | None:
    """When the command to take off reached the vehicle."""
    return next((at_s for at_s, order in truth.sent if order is Order.TAKE_OFF), None)
