"""The airframe of a simulated drone: it outlives its flights, and falls when its motors stop in the air. And the
interface of the autopilots that fly it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Protocol, Self

import numpy as np

from app.core.control.paparazzi import RATE_HZ, THROTTLE, Z_SUM_ERR
from app.core.errors import InputError, Problem
from app.vehicles.base import OptionValue, VehicleError
from app.vehicles.jsbsim import JSBSIM, JsbsimFlight
from app.vehicles.kernels import ALTITUDE, BATTERY, CLIMB_RATE, COMMAND_SIZE, KD, KI, KP, MODE, TARGET, THRUST, Integers
from app.vehicles.kinds import VehicleKind
from app.vehicles.mavlink.dialects import Dialect, FieldValue
from app.vehicles.simulated import Simulation
from app.vehicles.twin import TWIN, TwinFlight

TICK_STEPS: Final = 2
"""Steps of the simulation between two looks of an autopilot at its radio, its timers and its flight plan."""
TICK_S: Final = TICK_STEPS / RATE_HZ
FULL_BATTERY_V: Final = 11.1

_STANDS_BELOW_M: Final = 0.03
_STANDS_BELOW_M_S: Final = 0.1
_FULL_COMMAND: Final = 9600


class Flight(Simulation, Protocol):
    """A simulation whose autopilot's memory can be reached: the loop's state comes first in it."""

    autopilot: Integers


Launch = Callable[[int], Flight]
"""A new flight, standing on the ground, from its seed."""


def vertical_command(mode: int, target: int, kp: int = 0, ki: int = 0, kd: int = 0) -> Integers:
    """A command of the vertical loop, in its own integers."""
    command = np.empty(COMMAND_SIZE, dtype=np.int64)
    command[[MODE, TARGET, KP, KI, KD]] = (mode, target, kp, ki, kd)
    return command


MOTORS_OFF: Final = vertical_command(THROTTLE, 0)


def throttle_command(share: float) -> Integers:
    """Thrust as a share of full, for autopilots with a loop of their own."""
    return vertical_command(THROTTLE, round(min(max(share, 0.0), 1.0) * _FULL_COMMAND))


class Body:
    """The vehicle between power-on and power-off. Altitude is that above the ground it stands on.

    A flight is launched when the motors first push and is over when they rest on the ground; each has a seed of its
    own, counted up from the first. In between nothing moves and nothing is computed.
    """

    def __init__(self, launch: Launch, *, seed: int) -> None:
        self._launch = launch
        self._seed = seed
        self._flight: Flight | None = None
        self.altitude_m = 0.0
        self.climb_rate_m_s = 0.0
        self.thrust = 0.0
        self.battery_v = FULL_BATTERY_V
        self.north_m = 0.0
        """From where it was switched on."""
        self.steered_m_s = self.wind_m_s = 0.0
        """How fast its autopilot, and how fast the wind, moves it north while it is off the ground."""
        self.motors_dead = False
        """A fault: whatever is commanded, nothing turns."""

    @property
    def is_resting(self) -> bool:
        """On the ground with its motors still, and no flight begun since."""
        return self._flight is None

    @property
    def stands(self) -> bool:
        """On the ground, by height and speed."""
        return abs(self.altitude_m) < _STANDS_BELOW_M and abs(self.climb_rate_m_s) < _STANDS_BELOW_M_S

    @property
    def north_m_s(self) -> float:
        return 0.0 if self.is_resting or self.stands else self.steered_m_s + self.wind_m_s

    def advance(self, steps: int, command: Integers) -> None:
        """Let so many steps of 1/512 s pass under `command`. Raises VehicleError when the simulation broke down."""
        if self.motors_dead:
            command = MOTORS_OFF
        wants_to_rest = command[MODE] == THROTTLE and command[TARGET] == 0
        if wants_to_rest and (self._flight is None or self.stands):
            self._rest()
            return
        if self._flight is None:
            self._flight = self._launch(self._seed)
            self._seed += 1
        row = self._flight.advance(steps, command)[-1]
        if not np.isfinite(row).all():
            raise VehicleError(
                "The simulated drone broke down: its state is no longer a number.", hint="Start it again."
            )
        self.altitude_m, self.climb_rate_m_s = float(row[ALTITUDE]), float(row[CLIMB_RATE])
        self.thrust, self.battery_v = float(row[THRUST]), float(row[BATTERY])
        self.north_m += self.north_m_s * steps / RATE_HZ

    def forget_error_sum(self) -> None:
        """Empty the vertical loop's integrator."""
        if self._flight is not None:
            self._flight.autopilot[Z_SUM_ERR] = 0

    def _rest(self) -> None:
        self._flight = None
        self.altitude_m = self.climb_rate_m_s = self.thrust = 0.0
        self.battery_v = FULL_BATTERY_V


@dataclass(frozen=True, slots=True)
class Airframe:
    """A vehicle kind whose simulation a drone can fly, and that simulation, from options and seed."""

    kind: VehicleKind
    flight: Callable[[dict[str, float], int], Flight]


AIRFRAMES: Final[Mapping[str, Airframe]] = MappingProxyType(
    {"jsbsim": Airframe(JSBSIM, JsbsimFlight), "twin": Airframe(TWIN, TwinFlight)}
)


def new_body(vehicle: str, options: Mapping[str, OptionValue], *, seed: int) -> Body:
    """The body of a drone that flies as the vehicle kind of this name. Raises InputError for what does not exist."""
    if vehicle not in AIRFRAMES:
        raise InputError(
            "A simulated drone cannot have this body.",
            problems=(Problem("vehicle", f"must be one of {', '.join(AIRFRAMES)}, got {vehicle!r}"),),
            hint="jsbsim has six degrees of freedom; twin is a simple model with the real flights' scatter.",
        )
    airframe = AIRFRAMES[vehicle]
    numbers = {name: float(value) for name, value in airframe.kind.check(options, field="vehicle").items()}
    airframe.flight(numbers, seed).advance(TICK_STEPS, MOTORS_OFF)  # what is compiled on first use is compiled now
    return Body(lambda flight_seed: airframe.flight(numbers, flight_seed), seed=seed)


Fields = Mapping[str, FieldValue]

ARMED: Final = 128
"""The bit of HEARTBEAT.base_mode."""

# MAV_RESULT
ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
UNSUPPORTED: Final = 3
FAILED: Final = 4


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """A message on its way out, not yet packed. `counter` names the sequence counter that numbers it: Paparazzi has
    one for each of its source files. `system` is the sender's id where it is not the vehicle's own."""

    kind: str
    fields: Fields
    counter: str = ""
    system: int | None = None


class Autopilot(Protocol):
    """Flies its body, hears bytes and has letters to send; its time is counted in ticks since it was switched on."""

    dialect: Dialect
    system: int
    component: int
    refuses_arming: bool
    """A fault: arming is refused in this autopilot's own manner."""
    ignores_parameters: bool
    """A fault: PARAM_SET changes nothing and is not answered."""
    took_off: bool
    """Whether a takeoff was ever commanded."""

    @property
    def armed(self) -> bool: ...

    @property
    def is_by_hand(self) -> bool:
        """Whether a pilot flies it, and nobody has switched it out of that since."""
        ...

    def held(self, parameter: str) -> float:
        """What a parameter is now, whatever was said of it on the wire. Raises KeyError for an unknown name."""
        ...

    def receive(self, data: bytes) -> None:
        """Take in what the radio received."""
        ...

    def take_over(self) -> None:
        """A pilot switches to a mode of theirs, and holds it where it is."""
        ...

    def hand_back(self) -> None:
        """The pilot switches back to the mode in which it is told what to do."""
        ...

    def restore_persistent(self, before: Self) -> None:
        """Take over what outlives a reboot from itself as it was."""
        ...

    def tick(self) -> list[OutgoingMessage]:
        """Let one tick of TICK_S pass: answer what was heard, fly the body on, and return what is to be sent."""
        ...


@dataclass(slots=True)
class Timetable:
    """Telemetry at fixed periods, rounded down to whole ticks."""

    ticks: dict[str, int] = field(default_factory=dict)

    @classmethod
    def from_periods(cls, periods_s: Mapping[str, float]) -> "Timetable":
        table = cls()
        for kind, period_s in periods_s.items():
            table.set(kind, period_s)
        return table

    def set(self, kind: str, period_s: float) -> None:
        """From now on send `kind` every `period_s` seconds; 0 or less: never."""
        if period_s > 0.0:
            self.ticks[kind] = whole_ticks(period_s)
        else:
            self.ticks.pop(kind, None)

    def due(self, tick: int) -> list[str]:
        return [kind for kind, period in self.ticks.items() if tick % period == 0]


def whole_ticks(seconds: float) -> int:
    """At least one."""
    return max(int(seconds / TICK_S), 1)
