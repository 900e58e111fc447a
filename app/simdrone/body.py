"""Airframe of a simulated drone, which persists between flights and falls if its motors stop in the air, and the
interface of the autopilots that fly it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np

from app.autopilots.simulated.body import MOTORS_OFF, TICK_STEPS, VerticalCommand
from app.core.control.paparazzi import RATE_HZ, THROTTLE, Z_SUM_ERR
from app.core.errors import InputError, Problem
from app.vehicles.base import OptionValue, VehicleError
from app.vehicles.jsbsim import JSBSIM, JsbsimFlight
from app.vehicles.kernels import ALTITUDE, BATTERY, CLIMB_RATE, COMMAND_SIZE, KD, KI, KP, MODE, TARGET, THRUST, Integers
from app.vehicles.kinds import VehicleKind
from app.vehicles.simulated import Simulation
from app.vehicles.twin import TWIN, TwinFlight

FULL_BATTERY_V: Final = 11.1

_STANDS_BELOW_M: Final = 0.03
_STANDS_BELOW_M_S: Final = 0.1


class Flight(Simulation, Protocol):
    """A simulation with access to its autopilot's memory, which begins with the state of the loop."""

    autopilot: Integers


Launch = Callable[[int], Flight]
"""Creates a flight, standing on the ground, from its seed."""


def packed(command: VerticalCommand) -> Integers:
    """Return the command as the compiled loop takes it."""
    row = np.empty(COMMAND_SIZE, dtype=np.int64)
    row[[MODE, TARGET, KP, KI, KD]] = command
    return row


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

    def advance(self, steps: int, command: VerticalCommand) -> None:
        """Advance by `steps` steps of 1/512 s under `command`. Raises VehicleError if the simulation diverged."""
        if self.motors_dead:
            command = MOTORS_OFF
        wants_to_rest = command.mode == THROTTLE and command.target == 0
        if wants_to_rest and (self._flight is None or self.stands):
            self._rest()
            return
        if self._flight is None:
            self._flight = self._launch(self._seed)
            self._seed += 1
        row = self._flight.advance(steps, packed(command))[-1]
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
    airframe.flight(numbers, seed).advance(TICK_STEPS, packed(MOTORS_OFF))  # compile now what is compiled on first use
    return Body(lambda flight_seed: airframe.flight(numbers, flight_seed), seed=seed)
