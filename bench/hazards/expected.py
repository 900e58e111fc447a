"""What the documented table of failures asks for, held against what happened: the drone's own time line, the packets
that reached its antenna, and what it truly holds. Written from docs/real-flight.md, not from the program.

Every time limit of the table is given the slack of a heartbeat or reading that just missed it, and of the rig's clock.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from bench.hazards.cases import ABORT, MOCAP, MOTORS_OFF, OTHER_LANDING, OTHER_MODE, WILD_GAINS, Case
from bench.hazards.flying import Flown
from bench.hazards.intervals import Span, covers, longest, overlap, total
from bench.hazards.rig import Struck
from bench.hazards.stages import AIR, DESCENT, LIFTED_M, Stage
from bench.hazards.wire import Order

GROUND: Final = (Stage.PREFLIGHT, Stage.SET_GAINS)
SILENT: Final = ("link-lost", "wrong-system", "reboot")
DEAF: Final = ("link-lost", "reboot")
"""The vehicle hears nothing, either."""
GAIN_FAILURES: Final = (ABORT, WILD_GAINS, "no-lift-off")
HEARTBEAT_S: Final[Mapping[str, float]] = {"paparazzi": 0.5, "ardupilot": 1.0, "px4": 1.0}
BATTERY_S: Final[Mapping[str, float]] = {"paparazzi": 1.2, "ardupilot": 0.5, "px4": 0.2}
LIFT_OFF_S: Final[Mapping[str, float]] = {"paparazzi": 1.5, "ardupilot": 6.0, "px4": 8.0}

IMPACT_M_S: Final = 1.9
"""At more than this it has truly come to the ground in a fall."""
LAND_AGAIN_S: Final[Mapping[str, float]] = {"paparazzi": 6.0, "ardupilot": 1.0, "px4": 1.0}
"""After five seconds: under Paparazzi every order to land restarts the landing."""
DRIFT_M_S: Final = 0.1
SLACK_S: Final = 0.35
"""Of the rig's clock, and of a packet under way."""
STANDSTILL_S: Final = 1.05
"""Watched on the ground right before arming."""


@dataclass(frozen=True, slots=True)
class Cause:
    """A failure of the table that may have been met, what the trial is then worth, and whether it had to be met."""

    failure: str
    outcome: str
    had_to: bool = False


def faults(case: Case, flown: Flown) -> list[str]:
    """Everything that is not as it is asked for; nothing for a trial that is."""
    return list(_Judgement(case, flown).faults())


class _Judgement:
    def __init__(self, case: Case, flown: Flown) -> None:
        self.case, self.flown, self.stages = case, flown, flown.stages
        self.heartbeat_s = HEARTBEAT_S[case.autopilot]
        self.silent = self.of(*SILENT)
        self.beatless = self.of(*SILENT, "no-heartbeat")
        self.armed_s = self.stages.first_s(Stage.ARM)
        self.took_off_s = self.stages.first_s(Stage.TAKEOFF)

    def of(self, *kinds: str) -> list[Span]:
        return [(each.begun_s, each.ended_s) for each in self.flown.struck if each.kind in kinds]

    def of_flight(self, kind: str) -> list[Span]:
        """Where it set in after the command: before, it may have no effect."""
        return [(each.begun_s, each.ended_s) for each in self._kinds(kind) if each.stage in AIR]

    def within(self, spans: list[Span], *stages: Stage) -> float:
        return longest(spans, self.stages.spans(*stages))

    def began_in(self, kind: str, *stages: Stage) -> bool:
        return any(each.kind == kind and each.stage in stages for each in self.flown.struck)

    def faults(self) -> Iterator[str]:
        yield from self._outcome()
        yield from self._vehicle()
        yield from self._wire()
        yield from self._patience()

    # ---- what the trial is worth

    def _outcome(self) -> Iterator[str]:
        causes = [*self._on_ground(), *self._while_arming(), *self._in_the_air(), *self._coming_down()]
        outcome = self.flown.outcome
        allowed = {cause.outcome for cause in causes}
        if not any(cause.had_to for cause in causes):
            allowed.add("completed")
        if outcome not in allowed:
            known = ", ".join(sorted(f"{cause.failure} {cause.outcome}" for cause in causes)) or "nothing"
            yield f"the trial is {outcome}, where {known} was expected ({self.flown.reason})"
        if outcome == "completed" and self.stages.first_s(Stage.LAND) is None:
            yield "a completed trial did not record to the end"
        if outcome == "refused" and self.took_off_s is not None:
            yield "a trial that took off left no record"
        if self.flown.flew_on is not None and not _same(self.flown.flew_on, self.case.gains):
            yield f"it lifted off holding {dict(self.flown.flew_on)}"

    def _on_ground(self) -> Iterator[Cause]:
        """From the first packet to arming."""
        if self.within(self.beatless, Stage.CONNECT) >= 5.0 - self.heartbeat_s - SLACK_S:
            yield Cause("F1", "refused")
        if self.began_in("wrong-system", Stage.CONNECT) and not self.case.pinned:
            yield Cause("F1", "refused")
        for failure, kinds, shortest_s in (
            ("preflight", SILENT, 0.15),
            ("preflight", ("frozen-position", "jumping-position", "low-battery"), 0.0),
            ("preflight", MOCAP, 0.0),
            ("preflight", ("arm-refused", OTHER_LANDING), 0.0),
            ("F2", ("param-unconfirmed",), 0.0),
            ("F10", ("reboot", OTHER_MODE), 0.0),
        ):
            if self.within(self.of(*kinds), *GROUND) > shortest_s:
                yield Cause(failure, "refused")
        if self.within(self.beatless, *GROUND) > 2.5 * self.heartbeat_s - 0.1:
            yield Cause("preflight", "refused")
        if self.began_in(ABORT, Stage.CONNECT, *GROUND) or self.began_in(MOTORS_OFF, Stage.CONNECT, *GROUND):
            yield Cause("F8", "aborted", had_to=self.armed_s is not None)
        for kind in (*SILENT, "frozen-position", "jumping-position", "low-battery"):
            stale_s = STANDSTILL_S + (BATTERY_S[self.case.autopilot] if kind == "low-battery" else 0.0)
            if self.armed_s is not None and covers(self.of(kind), (self.armed_s - stale_s, self.armed_s)):
                yield Cause(f"preflight ({kind})", "refused", had_to=True)

    def _while_arming(self) -> Iterator[Cause]:
        arming = (Stage.ARM,)
        if self.within(self.silent, *arming) > 1.0 - SLACK_S or self.within(self.beatless, *arming) > 1.5 - SLACK_S:
            yield Cause("F3", "refused")
        if self.within(self.of("low-battery"), *arming) > 1.0 - SLACK_S:
            yield Cause("F7", "refused")
        if self.within(self.of("frozen-position", *MOCAP), *arming) > 0.15:
            yield Cause("F9a", "refused")
        if any(self.began_in(kind, *arming) for kind in ("reboot", OTHER_MODE)):
            yield Cause("F10", "refused")
        if self.began_in(ABORT, *arming) or self.began_in(MOTORS_OFF, *arming):
            yield Cause("F8", "aborted", had_to=True)
        refused = [covers(self.of("arm-refused"), (at_s, at_s)) for at_s in self.stages.ordered(Order.ARM)]
        if any(refused):
            yield Cause("F3", "refused", had_to=all(refused))

    def _in_the_air(self) -> Iterator[Cause]:
        """From the command to the end of the record. A condition that held for longer than its limit had to be met; had
        it not been, the record would be whole, so nothing more need be asked."""
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
            watched = AIR if self.took_off_s is None else (Stage.ARM, *AIR)
            lasted_s = self.within(spans, *watched)
            if lasted_s > may_s:
                yield Cause(failure, "invalid", had_to=lasted_s > must_s)
        if self.within(self.of("mocap-drift"), Stage.SET_GAINS, Stage.ARM, *AIR) > 1.0:
            yield Cause("F9c", "invalid")
        if self.began_in("reboot", *AIR):
            yield Cause("F10", "invalid", had_to=True)
        jumped_s = total(self.of("jumping-position"), self.stages.spans(Stage.ARM, *AIR))
        if jumped_s > 1.3:
            yield Cause("F9b", "invalid", had_to=jumped_s > 3.0)
        yield from self._suspect()

    def _suspect(self) -> Iterator[Cause]:
        """What speaks against the gains."""
        if self.began_in(ABORT, *AIR):
            yield Cause("F8", "aborted", had_to=True)
        if self.began_in(MOTORS_OFF, *AIR, *DESCENT):
            yield Cause("motors off", "aborted", had_to=True)
        if self.began_in(MOTORS_OFF, Stage.DISARM, Stage.RESTORE):
            yield Cause("motors off", "aborted")
        motorless_s = self.within(self.of("no-lift-off"), *AIR)
        if motorless_s > 0.0:
            yield Cause("F4/F6", "aborted", had_to=motorless_s > 3.0 + LIFT_OFF_S[self.case.autopilot])
        if self._may_have_stayed_down():
            yield Cause("F4", "aborted")
        if self.of(OTHER_MODE):
            yield Cause("F10", "invalid")
        if self.of(WILD_GAINS) and self.took_off_s is not None:
            yield Cause("F6", "aborted", had_to=True)

    def _may_have_stayed_down(self) -> bool:
        """Whether it may not have heard the command to take off, or may have been told otherwise before it climbed."""
        unheard = any(covers(self.of(*DEAF), (at_s, at_s)) for at_s in self.stages.ordered(Order.TAKE_OFF))
        return unheard or bool(self.of(OTHER_MODE, OTHER_LANDING))

    def _coming_down(self) -> Iterator[Cause]:
        """After a whole record: what still ends a landing early is told with it."""
        if self.began_in(ABORT, Stage.LAND):
            yield Cause("F8", "aborted")
        if self.within(self.of("no-lift-off"), Stage.LAND) > 0.0:
            yield Cause("F6", "aborted")
        if any(self.within(self.of(kind), Stage.LAND) > 0.0 for kind in ("reboot", OTHER_MODE)):
            yield Cause("F10", "invalid")

    # ---- the vehicle's end state

    def _vehicle(self) -> Iterator[str]:
        match self.flown.vehicle:
            case "safe":
                if not self.flown.holds_safe:
                    yield f"it is said to hold its safe gains, and holds {dict(self.flown.held)}"
                falls = bool(self.of(MOTORS_OFF))
                if self.flown.armed or (abs(self.flown.height_m) > LIFTED_M and not falls):
                    yield f"it is said to be safe, and is {'armed' if self.flown.armed else 'off the ground'}"
                if any(self.began_in(kind, *AIR) for kind in ("reboot",)):
                    yield "it changed its state by itself in the air, and was not quarantined"
            case "quarantined":
                if not any(self._doubts()):
                    yield f"it was quarantined without need ({self.flown.reason})"
            case "unopened":
                if self.flown.armed or not self._holds_no_trial():
                    yield f"it was never opened, and holds {dict(self.flown.held)}"

    def _holds_no_trial(self) -> bool:
        """Every gain is the safe one, or the one that it had before."""
        return all(
            self.flown.held[name] != gain or self.case.safe[name] == gain for name, gain in self.case.gains.items()
        )

    def _doubts(self) -> Iterator[bool]:
        """Reasons for which the safe gains cannot be verified, or the vehicle is somebody else's."""
        mute = self.of("param-unconfirmed")
        yield any(each.stage not in (Stage.CONNECT, *GROUND) for each in self._kinds("reboot", OTHER_MODE))
        yield any(each.kind == OTHER_MODE for each in self.flown.struck)
        yield self.flown.impact_m_s > IMPACT_M_S
        yield bool(self.of("mocap-drift"))  # the cameras go on seeing it in the air
        for lost_s, _ in self.stages.spans(Stage.LINK_LOST):
            yield any(end_s > lost_s + 60.0 - SLACK_S for _, end_s in self.beatless)
        for begun_s, _ in self.stages.spans(Stage.LAND, Stage.ABORT_LAND):
            blind = [*self.silent, *self.of("frozen-position")]
            yield any(end_s > begun_s + 20.0 and start_s < begun_s + 20.0 for start_s, end_s in blind)
        for begun_s, _ in self.stages.spans(Stage.DISARM):
            deaf = [*self.beatless, *self.of("frozen-position"), *mute]
            yield any(overlap(span, (begun_s - 0.6, begun_s + 5.5)) > 2.5 for span in deaf)
        over_s = self.stages.over_s
        for begun_s, _ in self.stages.spans(Stage.RESTORE):
            yield any(overlap(span, (begun_s, over_s + SLACK_S)) > 1.8 for span in [*self.silent, *mute])
        if self.flown.outcome == "refused":
            spans = [*self.silent, *mute]
            yield any(overlap(span, (over_s - SLACK_S, over_s + 15.0)) > 0.0 for span in spans)

    def _kinds(self, *kinds: str) -> list[Struck]:
        return [each for each in self.flown.struck if each.kind in kinds]

    # ---- what was sent

    def _wire(self) -> Iterator[str]:
        asked_s = min((each.begun_s for each in self._kinds(MOTORS_OFF)), default=float("inf"))
        for stop in self.flown.stops:
            if stop.height_m > LIFTED_M and stop.at_s < asked_s:
                yield f"its motors were told to stop at {stop.height_m:.2f} m"
        if self.stages.now is Stage.CONNECT and self.flown.packets:
            yield f"{self.flown.packets} packets were sent before a heartbeat was heard"
        for lost_s, end_s in self.stages.spans(Stage.LINK_LOST):
            lands = [at_s for at_s in self.stages.ordered(Order.LAND) if lost_s <= at_s <= end_s]
            gaps = [
                later - earlier
                for earlier, later in pairwise(lands)
                if later - earlier > (1.0 if earlier < lost_s + 4.0 else LAND_AGAIN_S[self.case.autopilot]) + SLACK_S
            ]
            if gaps:
                yield f"Land was not repeated for {max(gaps):.1f} s while the link was lost"
            if any(lost_s <= at_s < min(end_s, asked_s) for at_s in self.stages.ordered(Order.MOTORS_OFF)):
                yield "motors off was sent while the link was lost"
        yield from self._first_order_out_of_the_air()

    def _first_order_out_of_the_air(self) -> Iterator[str]:
        """Safe gains before Land where the gains are suspect, Land at once where they are not."""
        left = [end_s for _, end_s in self.stages.spans(*AIR) if end_s < self.stages.over_s]
        if not left:
            return
        told = (Order.GAIN, Order.LAND, Order.MOTORS_OFF)
        following = [(at_s, order) for at_s, order in self.stages.orders if at_s >= max(left) and order in told]
        first = following[0][1] if following else None
        if first is Order.MOTORS_OFF:
            return
        may_be_suspect = any(each.kind in GAIN_FAILURES and each.begun_s <= max(left) for each in self.flown.struck)
        may_be_suspect |= self.stages.first_s(Stage.RECORD) is None and self._may_have_stayed_down()
        if first is Order.GAIN and not may_be_suspect:
            yield "gains were sent before Land, though nothing spoke against them"
        is_aborted = self.flown.outcome == "aborted" and not self.of(MOTORS_OFF)
        if is_aborted and first is Order.LAND and self.stages.at(max(left)) is Stage.ABORT_LAND:
            yield "Land was sent before the safe gains, though the gains were suspect"
        lands = [at_s for at_s, order in following if order is Order.LAND]
        if first is Order.GAIN and (not lands or lands[0] - max(left) > 0.3 + SLACK_S):
            yield "Land did not follow the safe gains within 0.3 s"

    # ---- how long it waited

    def _patience(self) -> Iterator[str]:
        for stage, longest_s in (
            (Stage.ARM, 18.0),
            (Stage.TAKEOFF, LIFT_OFF_S[self.case.autopilot] + 3.0),
            (Stage.RECORD, 34.0),
            (Stage.LINK_LOST, 61.5 + self.heartbeat_s),
            (Stage.DISARM, 6.0),
        ):
            for begun_s, end_s in self.stages.spans(stage):
                if end_s - begun_s > longest_s:
                    yield f"it was in the state {stage} for {end_s - begun_s:.1f} s"
        for begun_s, end_s in self.stages.spans(Stage.LAND, Stage.ABORT_LAND):
            if end_s - begun_s > 41.5:
                yield f"it landed for {end_s - begun_s:.1f} s"
        for since_s in (each.begun_s for each in self._kinds(ABORT) if each.stage in AIR):
            left = [end_s for begun_s, end_s in self.stages.spans(*AIR) if begun_s <= since_s + SLACK_S]
            if left and max(left) - since_s > 0.05 + SLACK_S:
                yield f"an abort was not acted on for {max(left) - since_s:.2f} s"


def _same(held: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    """To single precision."""
    return all(math.isclose(held[name], value, rel_tol=1e-6) for name, value in wanted.items())
