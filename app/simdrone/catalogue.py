"""What simulated drones are made of: simulated autopilots by their names, and airframes, the simulations of vehicle
kinds as the flights of a body."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from app.autopilots.simulated.body import MOTORS_OFF, TICK_STEPS, Body, SimulatedKind, VerticalCommand
from app.autopilots.simulated_kinds import SIMULATED
from app.core.control.vertical_guidance import Z_SUM_ERR
from app.core.errors import InputError, Problem
from app.vehicles.base import OptionValue, VehicleError
from app.vehicles.jsbsim import JSBSIM, JsbsimFlight
from app.vehicles.kernels import ALTITUDE, BATTERY, CLIMB_RATE, COMMAND_SIZE, KD, KI, KP, MODE, TARGET, THRUST, Integers
from app.vehicles.kinds import VehicleKind
from app.vehicles.simulated import Simulation
from app.vehicles.twin import TWIN, TwinFlight


def get_autopilot(name: str) -> SimulatedKind:
    """Return the autopilot of this name. Raises InputError if it is unknown."""
    if name not in SIMULATED:
        raise InputError(
            "This simulated autopilot is unknown.",
            problems=(Problem("autopilot", f"must be one of {', '.join(SIMULATED)}, got {name!r}"),),
            hint="gainline sim-drone --help lists them.",
        )
    return SIMULATED[name]


class Simulated(Simulation, Protocol):
    """A simulation with access to its autopilot's memory, which begins with the state of the loop."""

    autopilot: Integers


def packed(command: VerticalCommand) -> Integers:
    """Return the command as the compiled loop takes it."""
    row = np.empty(COMMAND_SIZE, dtype=np.int64)
    row[[MODE, TARGET, KP, KI, KD]] = command
    return row


@dataclass(frozen=True, slots=True)
class _Flight:
    simulation: Simulated

    def advance(self, steps: int, command: VerticalCommand) -> tuple[float, float, float, float]:
        row = self.simulation.advance(steps, packed(command))[-1]
        if not np.isfinite(row).all():
            raise VehicleError(
                "The simulation of the drone diverged: its state is no longer finite.", hint="Start it again."
            )
        return float(row[ALTITUDE]), float(row[CLIMB_RATE]), float(row[THRUST]), float(row[BATTERY])

    def forget_error_sum(self) -> None:
        self.simulation.autopilot[Z_SUM_ERR] = 0


AIRFRAMES: Final[Mapping[str, tuple[VehicleKind, Callable[[dict[str, float], int], Simulated]]]] = {
    "jsbsim": (JSBSIM, JsbsimFlight),
    "twin": (TWIN, TwinFlight),
}
"""The vehicle kinds whose simulations a drone can fly, and what begins a flight of theirs from options and seed."""


def new_body(vehicle: str, options: Mapping[str, OptionValue], *, seed: int) -> Body:
    """Return the body of a drone that flies as this vehicle kind. Raises InputError for an unknown kind or option."""
    if vehicle not in AIRFRAMES:
        raise InputError(
            "A simulated drone cannot use this flight model.",
            problems=(Problem("vehicle", f"must be one of {', '.join(AIRFRAMES)}, got {vehicle!r}"),),
            hint="jsbsim has six degrees of freedom; twin is a simple model with the real flights' scatter.",
        )
    kind, flight = AIRFRAMES[vehicle]
    numbers = {name: float(value) for name, value in kind.check(options, field="vehicle").items()}
    _Flight(flight(numbers, seed)).advance(TICK_STEPS, MOTORS_OFF)  # compile now what is compiled on first use
    return Body(lambda flight_seed: _Flight(flight(numbers, flight_seed)), seed=seed)
