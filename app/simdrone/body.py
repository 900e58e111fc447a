"""Airframe of a simulated drone, which persists between flights and falls if its motors stop in the air, and the
interface of the autopilots that fly it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Protocol, Self

import numpy as np

from app.autopilots.dialects import Dialect, FieldValue
from app.core.control.paparazzi import RATE_HZ, THROTTLE, Z_SUM_ERR
from app.core.errors import InputError, Problem
from app.vehicles.base import OptionValue, VehicleError
from app.vehicles.jsbsim import JSBSIM, JsbsimFlight
from app.vehicles.kernels import ALTITUDE, BATTERY, CLIMB_RATE, COMMAND_SIZE, KD, KI, KP, MODE, TARGET, THRUST, Integers
from app.vehicles.kinds import VehicleKind
from app.vehicles.simulated import Simulation
from app.vehicles.twin import TWIN, TwinFlight

TICK_STEPS: Final = 2
"""Steps of the simulation between two updates of the autopilot's radio, timers and flight plan."""
TICK_S: Final = TICK_STEPS / RATE_HZ
FULL_BATTERY_V: Final = 11.1

_STANDS_BELOW_M: Final = 0.03
_STANDS_BELOW_M_S: Final = 0.1
_FULL_COMMAND: Final = 9600


class Flight(Simulation, Protocol):
    """A simulation with access to its autopilot's memory, which begins with the state of the loop."""

    autopilot: Integers


Launch = Callable[[int], Flight]
"""Creates a flight, standing on the ground, from its seed."""


def vertical_command(mode: int, target: int, kp: int = 0, ki: int = 0, kd: int = 0) -> Integers:
    """Return a command of the vertical loop, in its integers."""
    command = np.empty(COMMAND_SIZE, dtype=np.int64)
    command[[MODE, TARGET, KP, KI, KD]] = (mode, target, kp, ki, kd)
    return command


MOTORS_OFF: Final = vertical_command(THROTTLE, 0)


def throttle_command(share: float) -> Integers:
    """Return a command of thrust as a share of full, for autopilots with their own loop."""
    return vertical_command(THROTTLE, round(min(max(share, 0.0), 1.0) * _FULL_COMMAND))


class Body:
    """The vehicle between power-on and power-off. Altitude is above the ground at its place.

    A flight begins with the first thrust and ends when the motors are off on the ground; the seed is incremented for
    every flight. Between flights nothing is computed.
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
        """Position relative to the place where it was switched on."""
        self.steered_m_s = self.wind_m_s = 0.0
        """Speeds north, by its autopilot and by the wind, while it is off the ground."""
        self.motors_dead = False
        """Fault: the motors do not turn."""

    @property
    def is_resting(self) -> bool:
        """Whether it is on the ground with its motors off."""
        return self._flight is None

    @property
    def stands(self) -> bool:
        """Whether it is on the ground, by height and speed."""
        return abs(self.altitude_m) < _STANDS_BELOW_M and abs(self.climb_rate_m_s) < _STANDS_BELOW_M_S

    @property
    def north_m_s(self) -> float:
        return 0.0 if self.is_resting or self.stands else self.steered_m_s + self.wind_m_s

    def advance(self, steps: int, command: Integers) -> None:
        """Advance by `steps` steps of 1/512 s under `command`. Raises VehicleError if the simulation diverged."""
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
                "The simulation of the drone diverged: its state is no longer finite.", hint="Start it again."
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
    """A vehicle kind whose simulation a drone can fly; `flight` creates it from options and seed."""

    kind: VehicleKind
    flight: Callable[[dict[str, float], int], Flight]


AIRFRAMES: Final[Mapping[str, Airframe]] = MappingProxyType(
    {"jsbsim": Airframe(JSBSIM, JsbsimFlight), "twin": Airframe(TWIN, TwinFlight)}
)


def new_body(vehicle: str, options: Mapping[str, OptionValue], *, seed: int) -> Body:
    """Return the body of a drone that flies as this vehicle kind. Raises InputError for an unknown kind or option."""
    if vehicle not in AIRFRAMES:
        raise InputError(
            "A simulated drone cannot use this flight model.",
            problems=(Problem("vehicle", f"must be one of {', '.join(AIRFRAMES)}, got {vehicle!r}"),),
            hint="jsbsim has six degrees of freedom; twin is a simple model with the real flights' scatter.",
        )
    airframe = AIRFRAMES[vehicle]
    numbers = {name: float(value) for name, value in airframe.kind.check(options, field="vehicle").items()}
    airframe.flight(numbers, seed).advance(TICK_STEPS, MOTORS_OFF)  # compile now what is compiled on first use
    return Body(lambda flight_seed: airframe.flight(numbers, flight_seed), seed=seed)


Fields = Mapping[str, FieldValue]

ARMED: Final = 128
"""Bit of HEARTBEAT.base_mode."""

# MAV_RESULT
ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
UNSUPPORTED: Final = 3
FAILED: Final = 4


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """An outgoing message, not yet packed. `counter` names its sequence counter: Paparazzi has one for each of its
    source files. `system` is the sender's id if it is not the vehicle's own."""

    kind: str
    fields: Fields
    counter: str = ""
    system: int | None = None


class Autopilot(Protocol):
    """A simulated autopilot: it flies its body, receives bytes and returns messages to send. Its time is counted in
    ticks since it was switched on."""

    dialect: Dialect
    system: int
    component: int
    refuses_arming: bool
    """Fault: arming is refused as this autopilot does it."""
    ignores_parameters: bool
    """Fault: PARAM_SET changes nothing and has no reply."""
    took_off: bool
    """Whether a takeoff has been commanded."""

    @property
    def armed(self) -> bool: ...

    @property
    def is_by_hand(self) -> bool:
        """Whether it is in the mode in which a pilot flies it."""
        ...

    def held(self, parameter: str) -> float:
        """Return the true value of a parameter, whatever was sent. Raises KeyError for an unknown name."""
        ...

    def receive(self, data: bytes) -> None:
        """Process bytes received by the radio."""
        ...

    def take_over(self) -> None:
        """Switch to the pilot's mode, in which a pilot holds it in place."""
        ...

    def hand_back(self) -> None:
        """Switch back from the pilot's mode to the automatic one."""
        ...

    def kill(self) -> None:
        """Stop the motors, at any height, as another ground station commands."""
        ...

    def fly_home(self) -> None:
        """Enter the mode in which it flies home by itself."""
        ...

    def restore_persistent(self, before: Self) -> None:
        """Copy what survives a reboot from the autopilot before it."""
        ...

    def tick(self) -> list[OutgoingMessage]:
        """Advance by one tick of TICK_S: process received messages, fly the body, and return the messages to send."""
        ...


@dataclass(slots=True)
class Timetable:
    """Schedule of telemetry at fixed periods, rounded down to whole ticks."""

    ticks: dict[str, int] = field(default_factory=dict)

    @classmethod
    def from_periods(cls, periods_s: Mapping[str, float]) -> "Timetable":
        table = cls()
        for kind, period_s in periods_s.items():
            table.set(kind, period_s)
        return table

    def set(self, kind: str, period_s: float) -> None:
        """Send `kind` every `period_s` seconds from now on; never if 0 or less."""
        if period_s > 0.0:
            self.ticks[kind] = whole_ticks(period_s)
        else:
            self.ticks.pop(kind, None)

    def due(self, tick: int) -> list[str]:
        return [kind for kind, period in self.ticks.items() if tick % period == 0]


def whole_ticks(seconds: float) -> int:
    """Return the duration in whole ticks, at least one."""
    return max(int(seconds / TICK_S), 1)
