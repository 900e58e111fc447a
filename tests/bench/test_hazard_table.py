"""The table of hazards against the reducer of a trial alone: what each does to the messages that arrive, in each state
of a trial, has no consequence but those that it permits. `bench.hostile` flies the same table over a link.

Left out are hazards that the link or the connection finds before the reducer (a second vehicle with the same ids,
copies of packets, other components and ports, gains that were not verified), and all but one of the fields whose values
are no numbers, which a profile reads alike.
"""

import math
import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import product

import pytest

from app.vehicles.mavlink.events import (
    DISARMING,
    Action,
    ActionDone,
    Attitude,
    Battery,
    Command,
    CommandReply,
    GainsRestored,
    Heartbeat,
    InvalidPosition,
    LandedState,
    Measurement,
    Parameter,
    PerformAction,
    Position,
    RestoreGains,
    SecondaryAltitudeReceived,
    SendGain,
)
from app.vehicles.mavlink.records import ending_of, has_flown
from bench.hazards.cases import FOR_GOOD_S
from bench.hazards.hostile_checks import GroundTruth, ReportedOutcome, judge
from bench.hazards.hostile_table import HAZARDS
from bench.hazards.rig import InjectedFault
from bench.hazards.trial_states import LIFTED_M, State, TrialStates
from tests.bench.test_hostile import case
from tests.vehicles.mavlink.walking import GROUND_M, PLAN, STEP_S, TrialDriver, once

BY_HAND, HOMING = "64", "8"
BOOT_S = 2.0
LONGEST_S = 130.0
G_M_S2 = 9.81


@dataclass
class Flight(TrialDriver):
    """A vehicle that obeys, as far as its hazard lets it. `altitude_m` is the true one."""

    hazard: "Effect | None" = None
    has_second_source: bool = False
    wanted_m: float | None = None
    lands: bool = False
    late_s: float = 0.0
    obeys: bool = True
    lost_control: bool = False
    stops_m: list[float] = field(default_factory=list)
    due: list[tuple[float, Command]] = field(default_factory=list)

    @property
    def height_m(self) -> float:
        return self.altitude_m - GROUND_M

    def hear(self, measurement: Measurement | None) -> "Flight":
        arriving = [measurement] if self.hazard is None or measurement is None else self.hazard.change(measurement)
        for each in arriving:
            super().hear(each)
        return self

    def pass_s(self, seconds: float) -> "Flight":
        for _ in range(round(seconds / STEP_S)):
            self._carry_out()
            self._move()
            if self.hazard is not None:
                for each in self.hazard.insert():
                    TrialDriver.hear(self, each)
            super().pass_s(STEP_S)
            if self.has_second_source:
                self._see(self.altitude_m)
        return self

    def _see(self, altitude_m: float) -> None:
        seen_m, is_new = (altitude_m, True) if self.hazard is None else self.hazard.see(altitude_m)
        if seen_m is not None:
            self.give(SecondaryAltitudeReceived(seen_m, is_new=is_new, now_s=self.now_s))

    def _note(self, commands: tuple[Command, ...]) -> None:
        super()._note(commands)
        self.stops_m += [
            self.height_m
            for each in commands
            if isinstance(each, PerformAction) and each.action in (Action.MOTORS_OFF, Action.KILL)
        ]
        self.due += [(self.now_s + self.late_s, command) for command in commands]

    def _carry_out(self) -> None:
        arrived = [command for due_s, command in self.due if due_s <= self.now_s]
        self.due = [(due_s, command) for due_s, command in self.due if due_s > self.now_s]
        for command in arrived:
            match command:
                case RestoreGains():
                    self.give(GainsRestored(self.now_s))
                case PerformAction(action=action) if self.obeys:
                    self._obey(action)
                case SendGain(setting=setting) if self.obeys and not self.mute:
                    self.hear(Parameter(setting.parameter, setting.value))

    def _obey(self, action: Action) -> None:
        match action:
            case Action.ARM:
                self.armed = True
                self.give(ActionDone(Action.ARM, self.now_s))
            case Action.TAKE_OFF:
                self.wanted_m, self.lands = 3.0, False
            case Action.LAND:
                self.lands = True
            case Action.MOTORS_OFF | Action.KILL:
                self.armed, self.lost_control = False, self.height_m > LIFTED_M
                self.hear(CommandReply(DISARMING, accepted=True))

    def _move(self) -> None:
        """Climb or sink by at most 1 m/s to where it was told to; with its motors off in the air, fall."""
        if self.lost_control and self.height_m > 0.0:
            self.climb_rate_m_s = max(self.climb_rate_m_s - G_M_S2 * STEP_S, -self.height_m / STEP_S)
        elif self.lands:
            self.climb_rate_m_s = max(-0.8, min(0.0, -self.height_m / STEP_S))
        elif self.wanted_m is not None and self.armed:
            self.climb_rate_m_s = max(-1.0, min((self.wanted_m - self.altitude_m) / STEP_S, 1.0))
        else:
            self.climb_rate_m_s = 0.0


@dataclass
class Effect:
    """What a hazard does: to each message, beside them, and to the second source."""

    flight: Flight
    since_s: float = 0.0

    def begin(self) -> None:
        self.since_s = self.flight.now_s

    @property
    def lasted_s(self) -> float:
        return self.flight.now_s - self.since_s

    def change(self, measurement: Measurement) -> Iterable[Measurement]:
        return [measurement]

    def insert(self) -> Iterable[Measurement]:
        return ()

    def see(self, altitude_m: float) -> tuple[float | None, bool]:
        return altitude_m, True


Make = Callable[[Flight], Effect]


def changed(change: Callable[[Position, Effect], Measurement | None]) -> Make:
    """Positions are others, or do not arrive."""

    class Changed(Effect):
        def change(self, measurement: Measurement) -> Iterable[Measurement]:
            here = change(measurement, self) if isinstance(measurement, Position) else measurement
            return [] if here is None else [here]

    return Changed


def invalid(*, for_s: float = FOR_GOOD_S) -> Make:
    return changed(lambda here, effect: InvalidPosition(here.time_boot_s) if effect.lasted_s < for_s else here)


def higher(by_m: float) -> Make:
    return changed(lambda here, _: replace(here, altitude_m=here.altitude_m + by_m))


def on_ground(gap_s: float) -> Make:
    def change(here: Position, effect: Effect) -> Measurement:
        if effect.lasted_s < gap_s:
            return InvalidPosition(here.time_boot_s)
        return replace(here, altitude_m=0.1, climb_rate_m_s=0.0)

    return changed(change)


def stamped(by_s: float, *, once: bool) -> Make:
    class Stamped(Effect):
        done = False

        def change(self, measurement: Measurement) -> Iterable[Measurement]:
            if not isinstance(measurement, Position) or (once and self.done):
                return [measurement]
            self.done = True
            return [replace(measurement, time_boot_s=measurement.time_boot_s + by_s)]

    return Stamped


def inserted(make: Callable[[Flight], Measurement], every_s: float = FOR_GOOD_S) -> Make:
    class Inserted(Effect):
        due_s = -math.inf

        def insert(self) -> Iterable[Measurement]:
            if self.flight.now_s < self.due_s:
                return ()
            self.due_s = self.flight.now_s + every_s
            return [make(self.flight)]

    return Inserted


def false_position(height_m: float, *, ahead_s: float) -> Callable[[Flight], Measurement]:
    return lambda flight: Position(flight.boot_s + ahead_s, height_m, 0.0)


def silent(*kinds: type) -> Make:
    class Silent(Effect):
        def change(self, measurement: Measurement) -> Iterable[Measurement]:
            return [] if isinstance(measurement, kinds) else [measurement]

    return Silent


def delayed(late_s: Callable[[Effect, int], float]) -> Make:
    """Each message arrives so much later."""

    class Delayed(Effect):
        def begin(self) -> None:
            super().begin()
            self.count, self.held = 0, list[tuple[float, Measurement]]()

        def change(self, measurement: Measurement) -> Iterable[Measurement]:
            self.count += 1
            self.held.append((self.flight.now_s + late_s(self, self.count), measurement))
            return self.insert()

        def insert(self) -> Iterable[Measurement]:
            arrived = [each for due_s, each in self.held if due_s <= self.flight.now_s]
            self.held = [(due_s, each) for due_s, each in self.held if due_s > self.flight.now_s]
            return arrived

    return Delayed


class Lossy(Effect):
    """30 % of the messages are lost."""

    def begin(self) -> None:
        super().begin()
        self.chance = random.Random(1)

    def change(self, measurement: Measurement) -> Iterable[Measurement]:
        return [measurement] if self.chance.random() >= 0.3 else []


class Replaced(Effect):
    """Another vehicle answers after 1.3 s of silence: on the ground, disarmed, with a clock of its own."""

    def change(self, measurement: Measurement) -> Iterable[Measurement]:
        match measurement:
            case _ if self.lasted_s < 1.3:
                return []
            case Position():
                return [Position(measurement.time_boot_s - 17.0, 0.1, 0.0)]
            case Heartbeat():
                return [replace(measurement, armed=False)]
            case LandedState():
                return [LandedState(True)]
            case _:
                return [measurement]


def drifting(rate_m_s: float, *, witnessed: bool) -> Make:
    class Drifting(Effect):
        def change(self, measurement: Measurement) -> Iterable[Measurement]:
            if isinstance(measurement, LandedState) and not witnessed:
                return []
            if not isinstance(measurement, Position):
                return [measurement]
            altitude_m = measurement.altitude_m - rate_m_s * self.lasted_s
            return [replace(measurement, altitude_m=altitude_m, climb_rate_m_s=measurement.climb_rate_m_s - rate_m_s)]

    return Drifting


def stuck(*, witnessed: bool) -> Make:
    class Stuck(Effect):
        altitude_m: float | None = None

        def change(self, measurement: Measurement) -> Iterable[Measurement]:
            if isinstance(measurement, LandedState) and not witnessed:
                return []
            if not isinstance(measurement, Position):
                return [measurement]
            self.altitude_m = measurement.altitude_m if self.altitude_m is None else self.altitude_m
            return [replace(measurement, altitude_m=self.altitude_m, climb_rate_m_s=0.0)]

    return Stuck


def second(see: Callable[[float, Effect], tuple[float | None, bool]]) -> Make:
    class Second(Effect):
        def see(self, altitude_m: float) -> tuple[float | None, bool]:
            return see(altitude_m, self)

    return Second


def flown_by_hand(for_s: float = FOR_GOOD_S) -> Make:
    class Pilot(Effect):
        def insert(self) -> Iterable[Measurement]:
            flight, has_it = self.flight, self.lasted_s < for_s
            if has_it:
                flight.mode, flight.obeys, flight.lands, flight.wanted_m = BY_HAND, False, False, flight.altitude_m
            elif flight.mode == BY_HAND:
                flight.mode, flight.obeys = "4", True
            return ()

    return Pilot


def at_once(do: Callable[[Flight], None]) -> Make:
    class AtOnce(Effect):
        def begin(self) -> None:
            super().begin()
            do(self.flight)

    return AtOnce


def be_deaf(flight: Flight) -> None:
    flight.obeys, flight.deaf = False, True


def command_late(late_s: float) -> Make:
    def do(flight: Flight) -> None:
        flight.late_s = late_s

    return at_once(do)


def stop_motors(flight: Flight) -> None:
    flight.armed, flight.lost_control = False, flight.height_m > LIFTED_M


def fly_home(flight: Flight) -> None:
    flight.mode, flight.obeys, flight.lands, flight.wanted_m = HOMING, False, False, 3.0


class Rebooting(Effect):
    """Its motors stop; for 2 s nothing is heard, and then its clock begins again."""

    def begin(self) -> None:
        super().begin()
        stop_motors(self.flight)
        self.flight.mute, self.flight.obeys = True, False

    def insert(self) -> Iterable[Measurement]:
        if self.flight.mute and self.lasted_s >= BOOT_S:
            self.flight.mute, self.flight.obeys, self.flight.boot_s = False, True, 0.2
        return ()


class CarriedAway(Effect):
    """Northwards, at 2 m/s."""

    def insert(self) -> Iterable[Measurement]:
        self.flight.north_m += 2.0 * STEP_S
        return ()


class Oscillating(Effect):
    """A lean with a standard deviation of 28°, reported at 2 Hz."""

    def insert(self) -> Iterable[Measurement]:
        count, rest = divmod(round(self.lasted_s / STEP_S), round(0.5 / STEP_S))
        return [] if rest else [Attitude(abs(0.69 * math.sin(2.3 * count + 0.4)))]


EFFECTS: Mapping[str, Make] = {
    "z nan": invalid(),
    "z nan for 0.3 s": invalid(for_s=0.3),
    **{f"altitude {by_m:+g} m": higher(by_m) for by_m in (0.1, 0.2, -0.1, -0.2)},
    "replaced after 1.3 s": Replaced,
    **{f"on the ground after {gap_s:g} s": on_ground(gap_s) for gap_s in (0.0, 0.3, 0.6, 1.0)},
    "reboot once": inserted(lambda _: Position(0.2, 0.1, 0.0)),
    "ground once": inserted(false_position(0.1, ahead_s=0.005)),
    "ground every second": inserted(false_position(0.1, ahead_s=0.005), 1.0),
    "ceiling once": inserted(false_position(9.0, ahead_s=0.005)),
    "an hour ahead": inserted(false_position(0.1, ahead_s=3600.0), 1.0),
    "disarmed once": inserted(lambda _: Heartbeat(9, False, "4")),
    "disarmed every second": inserted(lambda _: Heartbeat(9, False, "4"), 1.0),
    "by hand once": inserted(lambda _: Heartbeat(9, True, BY_HAND)),
    "later and later, to 1 s": delayed(lambda effect, _: min(0.8 * effect.lasted_s, 1.0)),
    "later and later, to 2 s": delayed(lambda effect, _: min(1.5 * effect.lasted_s, 2.0)),
    "late by 0.4 s": delayed(lambda _, count: 0.0 if count % 3 else 0.4),
    "late by 2 s": delayed(lambda _, count: 0.0 if count % 7 else 2.0),
    **{
        f"{'one stamp' if once else 'all stamps'} {sign * by_s:+g} s": stamped(sign * by_s, once=once)
        for by_s, sign, once in product((0.1, 0.3, 0.5, 1.0, 2.0, 3.0), (1, -1), (True, False))
    },
    **{f"commands {late_s:g} s late": command_late(late_s) for late_s in (0.6, 1.2, 2.0)},
    "no HEARTBEAT": silent(Heartbeat),
    "no LOCAL_POSITION_NED": silent(Position),
    "no SYS_STATUS": silent(Battery),
    "no COMMAND_ACK": silent(CommandReply),
    "no PARAM_VALUE": silent(Parameter),
    "no EXTENDED_SYS_STATE": silent(LandedState),
    "30 % are lost": Lossy,
    "mocap nan": second(lambda _, __: (None, False)),
    "mocap silent": second(lambda _, __: (None, False)),
    "mocap frozen": second(lambda altitude_m, _: (altitude_m, False)),
    "mocap 1 m higher": second(lambda altitude_m, _: (altitude_m + 1.0, True)),
    "pilot": flown_by_hand(),
    "pilot for 1 s": flown_by_hand(1.0),
    "pilot for 3 s": flown_by_hand(3.0),
    "deaf": at_once(be_deaf),
    "carried away": CarriedAway,
    "reboot": Rebooting,
    "foreign kill": at_once(stop_motors),
    "flies home": at_once(fly_home),
    "drifts by 0.5 m/s": drifting(0.5, witnessed=True),
    "drifts by 0.1 m/s": drifting(0.1, witnessed=True),
    "drifts by 0.5 m/s unwitnessed": drifting(0.5, witnessed=False),
    "stuck altitude": stuck(witnessed=True),
    "stuck altitude unwitnessed": stuck(witnessed=False),
    "lean oscillation": Oscillating,
}
"""By the names of the table."""

BEGIN = {State.ARM: 0.1, State.TAKEOFF: 0.3, State.RECORD: 1.0, State.LAND: 0.5}
"""States in which a hazard sets in, and how long after they begin."""
LONG_RECORDED = {"no SYS_STATUS": 20.0}
"""Records long enough for a hazard that is noticed late, s."""


@once
def reached(state: State, *, has_second_source: bool = False, record_s: float = PLAN.record_s) -> Flight:
    """A flight in this state."""
    flight = Flight(plan=replace(PLAN, record_s=record_s), has_second_source=has_second_source)
    while flight.state.value != state:
        flight.pass_s(STEP_S)
    return flight.pass_s(BEGIN[state])


def flown(name: str, state: State) -> tuple[Flight, GroundTruth]:
    record_s = LONG_RECORDED.get(name, PLAN.record_s)
    flight = reached(state, has_second_source=name.startswith("mocap"), record_s=record_s)
    begun_s, flight.hazard = flight.now_s, EFFECTS[name](flight)
    flight.hazard.begin()
    while not flight.trial.is_over and flight.now_s < begun_s + LONGEST_S:
        flight.pass_s(STEP_S)
    lasts_s = HAZARDS[name].longest_s
    truth = GroundTruth(
        case=case("paparazzi", name, state, BEGIN[state], lasts_s),
        states=TrialStates(ended_s=flight.now_s),
        injected=[InjectedFault(name, state, begun_s, begun_s + lasts_s)],
        sent=(),
        stops=(),
        true_states=(),
        armed=flight.armed,
        holds_safe=True,
        rose_m=flight.climbed_m,
    )
    return flight, truth


LEFT_OUT = ("flies home", State.ARM)
"""Whether it rises before it was commanded to, only its body knows."""
RARE = {
    f"{which} {sign * by_s:+g} s"
    for which, by_s, sign in product(("one stamp", "all stamps"), (0.3, 0.5, 2.0, 3.0), (1, -1))
}
"""Further values of a hazard: on record alone, and not in the everyday ring."""


def is_asked(name: str, state: State) -> bool:
    is_further = name in RARE and state is not State.RECORD
    return state in HAZARDS[name].states and (name, state) != LEFT_OUT and not is_further


CELLS = [
    pytest.param(name, state, marks=() if state is State.RECORD and name not in RARE else pytest.mark.complete)
    for name, state in product(EFFECTS, BEGIN)
    if is_asked(name, state)
]


@pytest.mark.parametrize(("name", "state"), CELLS)
def test_a_hazard_has_no_consequence_that_its_row_does_not_permit(name: str, state: State) -> None:
    flight, truth = flown(name, state)
    trial = flight.trial
    assert trial.is_over
    reported = ReportedOutcome(
        outcome=ending_of(trial) if has_flown(trial) else "refused",
        vehicle="quarantined" if trial.state.value == "quarantined" else "safe",
        reason=trial.why,
        concern=trial.why,
        failure=trial.failure or "",
    )
    assert list(judge(truth, reported)) == []
    assert all(height_m < LIFTED_M for height_m in flight.stops_m), "motors off above the ground"


def test_without_a_hazard_the_vehicle_flies_lands_and_has_its_safe_gains_back() -> None:
    flight = reached(State.LAND)
    while not flight.trial.is_over:
        flight.pass_s(STEP_S)
    assert (flight.state, flight.trial.failure) == ("idle", None)
