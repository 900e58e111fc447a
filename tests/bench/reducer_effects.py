"""What the hazards of `bench.hostile` do to the messages that reach the reducer of a trial, by their names there."""

import math
import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import product

from app.autopilots.measurements import (
    Attitude,
    Battery,
    CommandReply,
    Heartbeat,
    InvalidPosition,
    LandedState,
    Measurement,
    Parameter,
    Position,
)
from bench.hazards.cases import FOR_GOOD_S
from bench.hazards.trial_states import LIFTED_M
from tests.bench.reducer_flight import Effect, Flight
from tests.vehicles.mavlink.walking import STEP_S

BY_HAND, HOMING = "64", "8"
BOOT_S = 2.0

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
