"""Checks of a trial with faults against the table of failures in docs/real-flight.md, independent of the program.

The input is what happened in the simulation: the drone's timeline, the packets that reached its antenna, and the gains
that it holds. Each time limit of the table has a tolerance for one missed heartbeat or reading and for the rig's clock.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from app.simdrone.drone import BOOT_S
from app.vehicles.flight_end import Failure
from bench.hazards.cases import (
    ABORT,
    FALSE_ALTITUDES,
    FLIES_HOME,
    FOREIGN_KILL,
    LEAN_OSCILLATION,
    MOCAP,
    MOTORS_OFF,
    OTHER_GAIN,
    OTHER_LANDING,
    OTHER_MODE,
    OTHER_TARGET,
    STALL,
    TAKEN_OVER,
    WILD_GAINS,
    Case,
)
from bench.hazards.fault_trial import TrialResult
from bench.hazards.intervals import Span, covers, longest, overlap, total
from bench.hazards.rig import InjectedFault
from bench.hazards.trial_states import AIR, DESCENT, LIFTED_M, RESTING_M, State
from bench.hazards.wire import Command

GROUND: Final = (State.PREFLIGHT, State.SET_GAINS)
STEPPING: Final = (State.ARM, *AIR)
"""States in which set points may be sent; the first is sent to Paparazzi before it takes off."""
SILENT: Final = ("link-lost", "wrong-system", "reboot")
UNSEEN: Final = ("frozen-position", "jumping-position", *FALSE_ALTITUDES, *MOCAP)
"""Faults in which the position of the vehicle is not known."""
DEAF: Final = ("link-lost", "reboot")
"""Faults in which the vehicle receives nothing either."""
GAIN_FAILURES: Final = (ABORT, WILD_GAINS, "no-lift-off", OTHER_TARGET, LEAN_OSCILLATION, FLIES_HOME, *FALSE_ALTITUDES)
JUST_SHOWN_S: Final = 0.15
"""Time in which a command may meet a pilot who has just taken over."""
HEARTBEAT_S: Final[Mapping[str, float]] = {"paparazzi": 0.5, "ardupilot": 1.0, "px4": 1.0}
BATTERY_S: Final[Mapping[str, float]] = {"paparazzi": 1.2, "ardupilot": 0.5, "px4": 0.2}
LIFT_OFF_S: Final[Mapping[str, float]] = {"paparazzi": 1.5, "ardupilot": 6.0, "px4": 8.0}

IMPACT_M_S: Final = 1.9
"""Speed of ground contact above which the vehicle has fallen."""
FELL_M_S: Final = 2.2
"""The same for a vehicle that has certainly fallen."""
LAND_AGAIN_S: Final[Mapping[str, float]] = {"paparazzi": 6.0, "ardupilot": 1.0, "px4": 1.0}
"""Interval of Land after five seconds: under Paparazzi each Land restarts the landing."""
DRIFT_M_S: Final = 0.1
LANDED_S: Final = 2.0
"""Time within which the autopilot itself reports that it has landed."""
DROP_M: Final = 0.5
"""Height from which the telemetry shows a vehicle in the air, whatever its noise and delay."""
SLACK_S: Final = 0.35
"""Tolerance for the rig's clock and for a packet in transit."""
STANDSTILL_S: Final = 1.05
"""Time for which the vehicle is watched on the ground right before arming."""


@dataclass(frozen=True, slots=True)
class Cause:
    """A failure of the table that may have occurred, the resulting outcome, and whether it must have occurred."""

    failure: str
    outcome: str
    is_certain: bool = False


def find_violations(case: Case, result: TrialResult) -> list[str]:
    """Return every violation of the table; empty if there is none."""
    return list(_Checker(case, result).find_violations())


class _Checker:
    def __init__(self, case: Case, result: TrialResult) -> None:
        self.case, self.result, self.states = case, result, result.states
        self.heartbeat_s = HEARTBEAT_S[case.autopilot]
        self.silent = self.of(*SILENT)
        self.beatless = self.of(*SILENT, "no-heartbeat")
        self.armed_s = self.states.first_s(State.ARM)
        self.took_off_s = self.states.first_s(State.TAKEOFF)
        self.stop_asked_s = min((begun_s for begun_s, _ in self.of(MOTORS_OFF)), default=float("inf"))

    def of(self, *kinds: str) -> list[Span]:
        return [(each.begun_s, each.ended_s) for each in self.result.injected if each.kind in kinds]

    def of_flight(self, kind: str) -> list[Span]:
        """Return the spans that begin after the takeoff command; earlier ones may have no effect."""
        return [(each.begun_s, each.ended_s) for each in self._kinds(kind) if each.state in AIR]

    def within(self, spans: list[Span], *states: State) -> float:
        return longest(spans, self.states.spans(*states))

    def began_in(self, kind: str, *states: State) -> bool:
        return any(each.kind == kind and each.state in states for each in self.result.injected)

    def find_violations(self) -> Iterator[str]:
        yield from self._outcome()
        yield from self._vehicle()
        yield from self._wire()
        yield from self._time_limits()

    # ---- the outcome of the trial

    def _outcome(self) -> Iterator[str]:
        causes = [*self._on_ground(), *self._while_arming(), *self._in_the_air(), *self._coming_down()]
        outcome = self.result.outcome
        allowed = {cause.outcome for cause in causes}
        had_its_time = any(cause.failure == "F4/F6" and cause.is_certain for cause in causes)
        if allowed and self._has_stayed_down() and not had_its_time:
            allowed.add("refused")
        if not any(cause.is_certain for cause in causes):
            allowed.add("completed")
        if outcome not in allowed:
            known = ", ".join(sorted(f"{cause.failure} {cause.outcome}" for cause in causes)) or "nothing"
            yield f"the trial is {outcome}, but {known} was expected ({self.result.reason})"
        if outcome == "completed" and self.states.first_s(State.LAND) is None:
            yield "a completed trial has no complete record"
        if not self.result.has_record and self.took_off_s is not None:
            yield "a trial that took off left no record"
        if outcome == "refused" and self.took_off_s is not None and self.result.rose_m > RESTING_M:
            yield f"the vehicle rose to {self.result.rose_m:.3f} m, but nothing is said to have been flown"
        changed = any(each.state in (State.ARM, State.TAKEOFF) for each in self._kinds(OTHER_GAIN))
        is_known = (changed and outcome != "completed") or self.began_in("reboot", State.TAKEOFF)
        if self.result.flew_on is not None and not _same(self.result.flew_on, self.case.gains) and not is_known:
            yield f"the vehicle lifted off with {dict(self.result.flew_on)}"

    def _on_ground(self) -> Iterator[Cause]:
        """Yield the failures from the first packet to arming."""
        if self.within(self.beatless, State.CONNECT) >= 5.0 - self.heartbeat_s - SLACK_S:
            yield Cause("F1", "refused")
        if self.began_in("wrong-system", State.CONNECT) and not self.case.pinned:
            yield Cause("F1", "refused")
        for failure, kinds, shortest_s in (
            ("preflight", SILENT, 0.15),
            ("preflight", ("frozen-position", "jumping-position", "low-battery"), 0.0),
            ("preflight", MOCAP, 0.0),
            ("preflight", ("arm-refused", OTHER_LANDING), 0.0),
            ("F2", ("param-unconfirmed",), 0.0),
            ("F10", ("reboot", OTHER_MODE, TAKEN_OVER), 0.0),
            ("F2", (OTHER_GAIN,), 0.0),
            ("preflight", ("silent-witness", FLIES_HOME, *FALSE_ALTITUDES, LEAN_OSCILLATION), 0.0),
        ):
            if self.within(self.of(*kinds), *GROUND) > shortest_s:
                yield Cause(failure, "refused")
        if self.within(self.beatless, *GROUND) > 2.5 * self.heartbeat_s - 0.1:
            yield Cause("preflight", "refused")
        if self.began_in(ABORT, State.CONNECT, *GROUND) or self.began_in(MOTORS_OFF, State.CONNECT, *GROUND):
            yield Cause("F8", "refused", is_certain=self.armed_s is not None)
        for kind in (*SILENT, "frozen-position", "jumping-position", "low-battery"):
            stale_s = STANDSTILL_S + (BATTERY_S[self.case.autopilot] if kind == "low-battery" else 0.0)
            if self.armed_s is not None and covers(self.of(kind), (self.armed_s - stale_s, self.armed_s)):
                yield Cause(f"preflight ({kind})", "refused", is_certain=True)

    def _while_arming(self) -> Iterator[Cause]:
        arming = (State.ARM,)
        if self.within(self.silent, *arming) > 1.0 - SLACK_S or self.within(self.beatless, *arming) > 1.5 - SLACK_S:
            yield Cause("F3", "refused")
        if self.within(self.of("low-battery"), *arming) > 1.0 - SLACK_S:
            yield Cause("F7", "refused")
        if self.within(self.of("frozen-position", *MOCAP), *arming) > 0.15:
            yield Cause("F9a", "refused")
        if self.within(self.of(*FALSE_ALTITUDES), *arming) > 0.15:
            yield Cause("F9", "refused")
        if any(self.began_in(kind, *arming) for kind in ("reboot", OTHER_MODE, OTHER_GAIN, FOREIGN_KILL, FLIES_HOME)):
            yield Cause("F10", "refused")
        if self.within(self.of(TAKEN_OVER), *arming) > 0.0:
            yield Cause("F10", "refused")
        if any(self.began_in(STALL, state) for state in (State.CONNECT, *GROUND, *arming)):
            yield Cause("F3", "refused")
        if self.began_in(ABORT, *arming) or self.began_in(MOTORS_OFF, *arming):
            yield Cause("F8", "refused", is_certain=True)
        refused = [covers(self.of("arm-refused"), (at_s, at_s)) for at_s in self.states.times_of(Command.ARM)]
        if any(refused):
            yield Cause("F3", "refused", is_certain=all(refused))

    def _in_the_air(self) -> Iterator[Cause]:
        """Yield the failures from the takeoff command to the end of the record.

        A condition that lasts longer than its limit must be detected; one that is not detected leaves a complete
        record, which the outcome shows.
        """
        battery_s = 1.0 + 2.0 * BATTERY_S[self.case.autopilot] + SLACK_S
        frozen = self.of("frozen-position")
        for failure, spans, may_s, must_s in (
            ("F5", self.silent, 1.0 - SLACK_S, 1.0 + SLACK_S),
            ("F5", self.beatless, 2.5 * self.heartbeat_s - 0.1, 3.5 * self.heartbeat_s + SLACK_S),
            ("F7", self.of("low-battery"), 1.0 - SLACK_S, battery_s),
            ("F9a", frozen, 0.15, 0.25 + SLACK_S),
            ("F9a", self.of("mocap-frozen"), 0.15, 0.25 + SLACK_S),
            ("F9a", self.of("mocap-lost"), 1.0 - SLACK_S, 1.0 + SLACK_S),
            ("F9c", self.of("mocap-drift"), 2.0, 0.3 / DRIFT_M_S + 0.3 + 1.0 + SLACK_S),
            ("F10", self.of_flight(OTHER_MODE), 0.0, 1.0 + 4.0 * self.heartbeat_s + SLACK_S),
            ("F11", self.of_flight(OTHER_LANDING), 0.0, 1.0 + 4.0 * self.heartbeat_s + SLACK_S),
        ):
            watched = AIR if self.took_off_s is None else (State.ARM, *AIR)
            lasted_s = self.within(spans, *watched)
            if lasted_s > may_s:
                yield Cause(failure, "invalid", is_certain=lasted_s > must_s)
        if self.within(self.of("mocap-drift"), State.SET_GAINS, State.ARM, *AIR) > 1.0:
            yield Cause("F9c", "invalid")
        if self.began_in("reboot", *AIR):
            yield Cause("F10", "invalid", is_certain=True)
        jumped_s = total(self.of("jumping-position"), self.states.spans(State.ARM, *AIR))
        if jumped_s > 1.3:
            yield Cause("F9b", "invalid", is_certain=jumped_s > 3.0)
        yield from self._by_wrong_altitudes()
        yield from self._by_other_people()
        yield from self._counting_against_gains()

    def _by_wrong_altitudes(self) -> Iterator[Cause]:
        """Yield the failures of a vehicle that stays where it is while its altitude shows something else, or that is
        not where it should be."""
        if self.within(self.of(*FALSE_ALTITUDES), State.SET_GAINS, State.ARM, *AIR, State.LAND) > 0.0:
            yield Cause("F9", "invalid")
            yield Cause("F4/F6", "aborted")
        home_s = self.within(self.of(FLIES_HOME), State.RECORD)
        if self.within(self.of(FLIES_HOME), State.ARM, *AIR, State.LAND) > 0.0:
            yield Cause("F10b", "invalid", is_certain=home_s > 2.0 * self.heartbeat_s + 2.0 + SLACK_S)
            yield Cause("F4", "aborted")
        if self.within(self.of(LEAN_OSCILLATION), *AIR, State.LAND) > 0.0:
            yield Cause("F6", "aborted", is_certain=self.within(self.of(LEAN_OSCILLATION), *AIR) > 6.0)

    def _by_other_people(self) -> Iterator[Cause]:
        """Yield the failures that a pilot, another ground station or this computer causes."""
        flown_s = self.within(self.of(TAKEN_OVER), State.RECORD)
        if self.within(self.of(TAKEN_OVER), State.ARM, *AIR) > 0.0:
            may_be_overridden = self.began_in(TAKEN_OVER, *GROUND, State.ARM)  # by the takeoff command
            is_shown = flown_s > 2.0 * self.heartbeat_s + 1.0 + SLACK_S
            yield Cause("F10a", "invalid", is_certain=is_shown and not may_be_overridden)
        if self.within(self.of(TAKEN_OVER), State.ARM, State.TAKEOFF) > 0.0:
            yield Cause("F4", "aborted")
        if self._kinds(OTHER_GAIN):
            yield Cause("F10c", "invalid", is_certain=self.began_in(OTHER_GAIN, *AIR) and not self.beatless)
        for begun_s, _ in self.of(OTHER_TARGET):
            yield Cause("F10c", "invalid", is_certain=self._leads_astray(begun_s))
            if self.case.autopilot != "px4":
                yield Cause("F6", "aborted")
        if self.began_in(FOREIGN_KILL, *AIR, State.LAND):
            yield Cause("F10b", "invalid", is_certain=self.began_in(FOREIGN_KILL, *AIR))
        stalled_s = self.within(self.of(STALL), State.RECORD)
        follows = bool(self.states.times_of(Command.FOLLOW))
        if self.within(self.of(STALL), *AIR) > 1.0 - SLACK_S:
            yield Cause("F5", "invalid")  # nothing was received for so long
        if self._kinds(STALL) and self.case.flies_steps:
            started_s = min(self.states.times_of(Command.FOLLOW), default=0.0)
            is_certain = follows and stalled_s > 0.5 + SLACK_S and min(self.of(STALL))[0] > started_s + 1.0
            yield Cause("F14", "invalid", is_certain=is_certain)

    def _leads_astray(self, begun_s: float) -> bool:
        """Whether an ArduCopter that holds a set point follows another one until a second heartbeat, or longer."""
        own = self.states.times_of(Command.SET_POINT)
        if self.case.autopilot != "ardupilot" or not own or begun_s < own[0] + SLACK_S or self.beatless:
            return False
        later = (*own, *(end_s for _, end_s in self.states.spans(*AIR)))
        ends_s = min((at_s for at_s in later if at_s > begun_s), default=begun_s)
        return ends_s - begun_s > 0.3 + self.heartbeat_s + 2.0 * SLACK_S

    def _counting_against_gains(self) -> Iterator[Cause]:
        """Yield the failures that count against the gains."""
        if self.began_in(ABORT, *AIR):
            yield Cause("F8", "aborted", is_certain=True)
        if self.began_in(MOTORS_OFF, *AIR, *DESCENT):
            yield Cause("motors off", "aborted", is_certain=True)
        if self.began_in(MOTORS_OFF, State.DISARM, State.RESTORE):
            yield Cause("motors off", "aborted")
        motorless_s = self.within(self.of("no-lift-off"), *AIR)
        if motorless_s > 0.0:
            yield Cause("F4/F6", "aborted", is_certain=motorless_s > 3.0 + LIFT_OFF_S[self.case.autopilot])
        if self._may_have_stayed_down():
            yield Cause("F4", "aborted")
        if self.of(OTHER_MODE):
            yield Cause("F10", "invalid")
        if self.of(WILD_GAINS) and self.took_off_s is not None:
            yield Cause("F6", "aborted", is_certain=True)

    def _has_stayed_down(self) -> bool:
        """Whether the vehicle truly never left the ground after the takeoff command."""
        return self.took_off_s is not None and self.result.rose_m <= RESTING_M

    def _may_have_stayed_down(self) -> bool:
        """Whether the takeoff command may not have arrived, or another command may have followed before the climb."""
        unheard = any(covers(self.of(*DEAF), (at_s, at_s)) for at_s in self.states.times_of(Command.TAKE_OFF))
        return unheard or bool(self.of(OTHER_MODE, OTHER_LANDING, TAKEN_OVER))

    def _coming_down(self) -> Iterator[Cause]:
        """Yield the failures after a complete record that can still interrupt the landing."""
        if self.began_in(ABORT, State.LAND):
            yield Cause("F8", "aborted")
        if self.within(self.of("no-lift-off"), State.LAND) > 0.0:
            yield Cause("F6", "aborted")
        if any(self.within(self.of(kind), State.LAND) > 0.0 for kind in ("reboot", OTHER_MODE, TAKEN_OVER)):
            yield Cause("F10", "invalid")

    # ---- the state of the vehicle afterwards

    def _vehicle(self) -> Iterator[str]:
        match self.result.vehicle:
            case "safe":
                yield from self._reported_as_safe()
            case "quarantined":
                if not any(self._reasons_for_quarantine()):
                    yield f"unnecessary quarantine ({self.result.reason})"
            case "unopened":
                if self.result.armed or not self._holds_no_trial():
                    yield f"never connected, but holds {dict(self.result.held)}"

    def _reported_as_safe(self) -> Iterator[str]:
        result = self.result
        if not result.holds_safe and not self.began_in(OTHER_GAIN, State.RESTORE):
            yield f"reported as holding its safe gains, but holds {dict(result.held)}"
        if result.armed or abs(result.height_m) > LIFTED_M:
            yield f"reported as safe, but is {'armed' if result.armed else 'off the ground'}"
        if self.began_in("reboot", *AIR):
            yield "the autopilot restarted in the air, but the vehicle was not quarantined"
        if result.impact_m_s > FELL_M_S:
            yield f"it hit the ground at {result.impact_m_s:.1f} m/s, but the vehicle was not quarantined"
        if self._dropped_m() > DROP_M:
            yield f"its motors were stopped at {self._dropped_m():.2f} m, but the vehicle was not quarantined"

    def _dropped_m(self) -> float:
        """Return the height at which the operator's first motors off reached the vehicle; 0 if none did."""
        return next((stop.height_m for stop in self.result.stops if stop.at_s >= self.stop_asked_s), 0.0)

    def _holds_no_trial(self) -> bool:
        """Whether no gain is the trial's, unless it equals the safe one."""
        return all(
            self.result.held[name] != gain or self.case.safe[name] == gain for name, gain in self.case.gains.items()
        )

    def _reasons_for_quarantine(self) -> Iterator[bool]:
        """Yield, for each reason that justifies quarantine, whether it applies."""
        mute = self.of("param-unconfirmed")
        yield any(each.state not in (State.CONNECT, *GROUND) for each in self._kinds("reboot", OTHER_MODE))
        yield any(each.kind in (OTHER_MODE, TAKEN_OVER) for each in self.result.injected)
        yield self.began_in(OTHER_GAIN, State.DISARM, State.RESTORE)
        unseen = [*self.silent, *self.of("frozen-position")]
        for descent in self.states.spans(State.LAND, State.ABORT_LAND, State.LINK_LOST):  # it may have fallen
            yield any(overlap(span, descent) > 1.0 for span in unseen)
        yield self.began_in(OTHER_LANDING, State.TAKEOFF)  # on the ground, its autopilot disarms it at once (F10b)
        yield self.result.impact_m_s > IMPACT_M_S
        yield bool(self.of("mocap-drift"))  # motion capture still shows it in the air
        yield bool(self.of("silent-witness", FOREIGN_KILL, FLIES_HOME, *FALSE_ALTITUDES))
        yield self._dropped_m() > RESTING_M
        for begun_s, _ in self.of(MOTORS_OFF):  # it was not seen on the ground when they were stopped
            yield any(covers(self.of(kind), (begun_s, begun_s)) for kind in (*SILENT, *UNSEEN))
            yield 0.0 <= begun_s - self.result.touched_down_s < LANDED_S
        for lost_s, _ in self.states.spans(State.LINK_LOST):
            yield any(end_s > lost_s + 60.0 - SLACK_S for _, end_s in self.beatless)
        for begun_s, _ in self.states.spans(State.LAND, State.ABORT_LAND):
            blind = [*self.silent, *self.of("frozen-position")]
            yield any(end_s > begun_s + 20.0 and start_s < begun_s + 20.0 for start_s, end_s in blind)
        for begun_s, _ in self.states.spans(State.DISARM):
            deaf = [*self.beatless, *self.of("frozen-position"), *mute]
            yield any(overlap(span, (begun_s - 0.6, begun_s + 5.5)) > 2.5 for span in deaf)
        ended_s = self.states.ended_s
        for begun_s, _ in self.states.spans(State.RESTORE):
            yield any(overlap(span, (begun_s, ended_s + SLACK_S)) > 1.8 for span in [*self.silent, *mute])
        if self.result.outcome == "refused":
            spans = [*self.silent, *mute]
            heard_s = ended_s - self.heartbeat_s - SLACK_S
            yield any(overlap(span, (heard_s, ended_s + 15.0)) > 0.0 for span in spans)

    def _kinds(self, *kinds: str) -> list[InjectedFault]:
        return [each for each in self.result.injected if each.kind in kinds]

    # ---- the packets that were sent

    def _wire(self) -> Iterator[str]:
        for stop in self.result.stops:
            if stop.height_m > LIFTED_M and stop.at_s < self.stop_asked_s:
                yield f"motors off was sent at {stop.height_m:.2f} m"
        if self.states.now is State.CONNECT and self.result.packets:
            yield f"{self.result.packets} packets were sent before a heartbeat was heard"
        for lost_s, end_s in self.states.spans(State.LINK_LOST):
            lands = [at_s for at_s in self.states.times_of(Command.LAND) if lost_s <= at_s <= end_s]
            gaps = [
                later - earlier
                for earlier, later in pairwise(lands)
                if later - earlier > (1.0 if earlier < lost_s + 4.0 else LAND_AGAIN_S[self.case.autopilot]) + SLACK_S
            ]
            if gaps and not self._kinds(STALL, TAKEN_OVER):
                yield f"Land was not repeated for {max(gaps):.1f} s while the link was lost"
            if any(lost_s <= at_s < min(end_s, self.stop_asked_s) for at_s in self.states.times_of(Command.MOTORS_OFF)):
                yield "motors off was sent while the link was lost"
        for command in (Command.SET_POINT, Command.FOLLOW):
            wrong = {
                str(state) for at_s in self.states.times_of(command) if (state := self.states.at(at_s)) not in STEPPING
            }
            yield from (f"“{command}” was sent in the state {state}" for state in sorted(wrong))
        yield from self._overridden_pilots()
        yield from self._first_command_out_of_the_air()

    def _overridden_pilots(self) -> Iterator[str]:
        """Yield commands to a vehicle of which a heartbeat has shown that a pilot flies it."""
        for each in self.result.overridden:
            if each.command is Command.FOLLOW and each.flown_s > JUST_SHOWN_S:
                yield f"“{each.command}” was sent to a vehicle that a pilot had flown for {each.flown_s:.2f} s"
            is_known = each.shown_s is not None and each.shown_s > JUST_SHOWN_S
            is_known = is_known and not self.beatless and not self._kinds(ABORT, STALL)
            if each.command is not Command.FOLLOW and is_known:
                yield f"“{each.command}” was sent {each.shown_s:.2f} s after a heartbeat that showed a pilot"

    def _first_command_out_of_the_air(self) -> Iterator[str]:
        """Check that the safe gains precede Land only if the gains are suspect."""
        left = [end_s for _, end_s in self.states.spans(*AIR) if end_s < self.states.ended_s]
        if not left:
            return
        deciding = (Command.GAIN, Command.LAND, Command.MOTORS_OFF)
        following = [
            (at_s, command) for at_s, command in self.states.commands if at_s >= max(left) and command in deciding
        ]
        first = following[0][1] if following else None
        if first is Command.MOTORS_OFF:
            return
        may_be_suspect = any(each.kind in GAIN_FAILURES and each.begun_s <= max(left) for each in self.result.injected)
        may_be_suspect |= self.states.first_s(State.RECORD) is None and self._may_have_stayed_down()
        may_be_suspect |= self.within(self.of(TAKEN_OVER), State.ARM, State.TAKEOFF) > 0.0
        may_be_suspect |= self.result.failure is Failure.NOT_SETTLED
        if first is Command.GAIN and not may_be_suspect:
            yield "the safe gains were sent before Land, though the gains were not suspect"
        is_refused = self.result.outcome == "refused" and self.began_in(ABORT, *AIR)
        is_aborted = (self.result.outcome == "aborted" or is_refused) and not self.of(MOTORS_OFF)
        if is_aborted and first is Command.LAND and self.states.at(max(left)) is State.ABORT_LAND:
            yield "Land was sent before the safe gains, though the gains were suspect"
        lands = [at_s for at_s, command in following if command is Command.LAND]
        if first is Command.GAIN and (not lands or lands[0] - max(left) > 0.3 + SLACK_S):
            yield "Land did not follow the safe gains within 0.3 s"

    # ---- time limits

    def _time_limits(self) -> Iterator[str]:
        for state, longest_s in (
            (State.ARM, 18.0),
            (State.TAKEOFF, LIFT_OFF_S[self.case.autopilot] + 3.0),
            (State.RECORD, 34.0),
            (State.LINK_LOST, 61.5 + self.heartbeat_s),
            (State.DISARM, 6.0),
        ):
            for begun_s, end_s in self.states.spans(state):
                if end_s - begun_s > longest_s:
                    yield f"the state {state} lasted {end_s - begun_s:.1f} s"
        for begun_s, end_s in self.states.spans(State.LAND, State.ABORT_LAND):
            ended_by = [
                each.begun_s + (BOOT_S if each.kind == "reboot" else 0.0)
                for each in self.result.injected
                if each.state is State.LAND
            ]
            if end_s - max([begun_s, *ended_by]) > 42.0:  # a failure during a landing begins another one
                yield f"the landing lasted {end_s - begun_s:.1f} s"
        for since_s in (each.begun_s for each in self._kinds(ABORT) if each.state in AIR):
            left = [end_s for begun_s, end_s in self.states.spans(*AIR) if begun_s <= since_s + SLACK_S]
            if left and max(left) - since_s > 0.05 + SLACK_S and not self._kinds(STALL):
                yield f"an abort took effect only after {max(left) - since_s:.2f} s"


def _same(held: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    """Whether the gains are equal in single precision."""
    return all(math.isclose(held[name], value, rel_tol=1e-6) for name, value in wanted.items())
