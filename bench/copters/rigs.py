"""What a benchmark needs of each autopilot: the loop of the first flight, flights of the steps, a grid of gains."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.px4.replica import parameters as px4_parameters
from bench.copters.px4_simulation import fly_changes, sample_px4
from bench.copters.px4_simulation import loop_of as px4_loop_of
from bench.copters.simulation import SimulatedCopter, StepFlight, fly_steps, loop_of, sample


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """`sample` draws a vehicle, `first_loop` has default gains, `fly` takes a vehicle, the loop and a seed of the
    weather; `grid` has values of each gain, in the order of the loop's space."""

    sample: Callable[[np.random.Generator], SimulatedCopter]
    first_loop: Callable[[SimulatedCopter], Any]
    fly: Callable[[SimulatedCopter, Any, int], StepFlight]
    grid: Sequence[Sequence[float]]


def _first_loop_of_ardupilot(copter: SimulatedCopter) -> ArduPilotLoop:
    return loop_of(Parameters(hover_throttle=copter.assumed_hover_throttle))


def _fly_ardupilot(copter: SimulatedCopter, loop: ArduPilotLoop, seed: int) -> StepFlight:
    return fly_steps(copter, loop.parameters, seed=seed)


def _first_loop_of_px4(copter: SimulatedCopter) -> Px4Loop:
    return px4_loop_of(px4_parameters.Parameters(hover_thrust=copter.assumed_hover_throttle))


def _fly_px4(copter: SimulatedCopter, loop: Px4Loop, seed: int) -> StepFlight:
    return fly_changes(copter, loop.parameters, seed=seed)


RIGS: Final[Mapping[str, Rig]] = {
    "ArduCopter": Rig(
        sample=sample,
        first_loop=_first_loop_of_ardupilot,
        fly=_fly_ardupilot,
        grid=((1.0, 1.7, 3.0), (5.0, 6.5, 8.0), (0.2, 0.3, 0.45, 0.65, 1.0, 1.5), (0.4, 0.7, 1.2, 1.7, 2.4, 3.0)),
    ),
    "PX4": Rig(
        sample=sample_px4,
        first_loop=_first_loop_of_px4,
        fly=_fly_px4,
        grid=((0.5, 1.0, 1.5), (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 11.0), (0.5, 1.0, 2.0, 3.0), (0.0, 0.2, 0.5)),
    ),
}
