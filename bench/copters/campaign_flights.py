"""Flights of a campaign's altitude steps on random copters, recorded as over a link.

They begin in hover at the first height: the climb is not part of what is fitted or scored. Every set point takes effect
a little later than commanded.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.autopilots.ardupilot.replica.parameters import DEFAULTS, STEP_S, parameters_from
from app.autopilots.px4.replica import parameters as px4_parameters
from app.autopilots.registry import get_experiment
from app.core.experiments.copter_steps import CopterSteps
from app.core.models.set_points import SetPoints
from app.core.records.trajectory import Samples, Trajectory
from bench.copters import px4_simulation, simulation
from bench.copters.px4_simulation import sample_px4
from bench.copters.simulation import SimulatedCopter, sample

_BEYOND_S: Final = 0.4
_LATEST_S: Final = 0.2
_RECORD_HZ: Final = 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRig:
    """An autopilot with random vehicles: its experiment, what of the vehicle's parameters differs from the firmware's
    defaults, and flights with gains and a seed of the weather. `counts_reference` if the throttle that the reference
    alone commands counts as activity."""

    experiment: CopterSteps
    sample: Callable[[np.random.Generator], SimulatedCopter]
    parameters: Callable[[SimulatedCopter], Mapping[str, float]]
    fly: Callable[[CopterSteps, SimulatedCopter, Mapping[str, float], int], Trajectory]
    counts_reference: bool


def _copter_steps(name: str) -> CopterSteps:
    experiment = get_experiment(name)
    assert isinstance(experiment, CopterSteps)
    return experiment


def _late(set_points: SetPoints, seed: int) -> SetPoints:
    late_s = np.random.default_rng(seed).uniform(0.0, _LATEST_S, len(set_points.times_s) - 1)
    return replace(set_points, times_s=(0.0, *(set_points.times_s[1:] + late_s).tolist()))


def _fly_ardupilot(
    experiment: CopterSteps, copter: SimulatedCopter, values: Mapping[str, float], seed: int
) -> Trajectory:
    time_s = np.arange(0.0, experiment.window_s + _BEYOND_S, STEP_S)
    targets = _late(experiment.set_points, seed).at(time_s)
    flown = simulation.fly_targets(copter, parameters_from(values), targets, seed=seed)
    columns = {"altitude_m": 0, "climb_rate_m_s": 1, "throttle": 7, "reference_m": 3}
    return _record(experiment, time_s, {name: flown[:, column] for name, column in columns.items()})


def _fly_px4(experiment: CopterSteps, copter: SimulatedCopter, values: Mapping[str, float], seed: int) -> Trajectory:
    step_s = px4_parameters.STEP_S
    time_s = np.arange(0.0, experiment.window_s + _BEYOND_S, step_s)
    reference = np.zeros((len(time_s), 3))
    set_points = _late(experiment.set_points, seed)
    reference[:, 0], reference[:, 2] = set_points.at(time_s), set_points.acceleration_at(time_s)
    flown = px4_simulation.fly_reference(copter, px4_parameters.parameters_from(values), reference, seed=seed)
    columns = {"altitude_m": flown[:, 0], "climb_rate_m_s": flown[:, 1], "throttle": flown[:, 3]}
    return _record(experiment, time_s, {**columns, "reference_m": reference[:, 0]})


def _record(experiment: CopterSteps, time_s: Samples, channels: Mapping[str, Samples]) -> Trajectory:
    """The stored record, a sample every 20 ms."""
    rows = np.unique(np.round(np.arange(0.0, time_s[-1], 1.0 / _RECORD_HZ) / (time_s[1] - time_s[0])).astype(np.int64))
    named = {name: values[rows] for name, values in channels.items()}
    named["set_point_m"] = experiment.set_point(time_s[rows])
    return Trajectory(time_s[rows], named, "mavlink", "vehicle").as_stored()


def _ardupilot_parameters(copter: SimulatedCopter) -> Mapping[str, float]:
    return {**DEFAULTS, "MOT_THST_HOVER": copter.assumed_hover_throttle, "INS_ACCEL_FILTER": simulation.FILTER_HZ}


def _px4_parameters(copter: SimulatedCopter) -> Mapping[str, float]:
    return {**px4_parameters.DEFAULTS, "MPC_THR_HOVER": copter.assumed_hover_throttle, "IMU_INTEG_RATE": 250.0}


RIGS: Final[Mapping[str, CampaignRig]] = {
    "ArduCopter": CampaignRig(
        experiment=_copter_steps("altitude-steps-ardupilot"),
        sample=sample,
        parameters=_ardupilot_parameters,
        fly=_fly_ardupilot,
        counts_reference=True,
    ),
    "PX4": CampaignRig(
        experiment=_copter_steps("altitude-steps-px4"),
        sample=sample_px4,
        parameters=_px4_parameters,
        fly=_fly_px4,
        counts_reference=False,
    ),
}
