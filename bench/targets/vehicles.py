"""Random vehicles for testing tuning methods: their flights, a safety criterion, and each one's best error."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.stats import qmc

from app.core.errors import InputError, Problem
from app.core.experiments.base import Matrix
from app.core.experiments.takeoff import Takeoff
from app.core.models.vertical import GRAVITY_M_S2
from app.core.policy import Box, Gains, Vector
from app.core.records.trajectory import Samples, Trajectory
from app.core.tuning.campaign_models import minimise_in_box
from app.vehicles.base import OptionValue
from app.vehicles.jsbsim import FULL_THRUST_N, JsbsimFlight
from app.vehicles.kernels import ALTITUDE, Rows
from app.vehicles.registry import check_options
from app.vehicles.simulated import Simulation, simulate_flight, trajectory_of
from app.vehicles.twin import TwinFlight

HIGHEST_M: Final = 3.75
LOWEST_M: Final = 2.25
SETTLED_S: Final = 5.0
"""An altitude is unsafe above `HIGHEST_M`, and below `LOWEST_M` from this time after the command on."""

JSBSIM_EVERY: Final = 10
"""Every tenth vehicle with further physics flies in JSBSim, with gusts."""

_QUIET: Final = {"twin": {"scatter": 0.0}, "jsbsim": {"gust_m_s": 0.0, "altitude_noise_m": 0.0}}
_SIMULATIONS: Final[Mapping[str, Callable[[dict[str, float], int], Simulation]]] = MappingProxyType(
    {"twin": TwinFlight, "jsbsim": JsbsimFlight}
)
_TAKEOFF: Final = Takeoff()


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledVehicle:
    """One vehicle of a population: `number` counts from 1, `options` are complete."""

    population: str
    number: int
    kind: str
    options: Mapping[str, OptionValue]

    @property
    def quiet(self) -> "SampledVehicle":
        """The same vehicle without any variation between its flights."""
        return replace(self, options={**self.options, **_QUIET[self.kind]})


def population(name: str, count: int, seed: int) -> tuple[SampledVehicle, ...]:
    """The first `count` vehicles of a population; a larger count does not change the first ones.

    `four-parameter`: twins with hover throttle 0.45 … 0.75, motor lag 0 … 100 ms, latency 0 … 0.4 s, drag 0 … 0.4 1/s.
    `further-physics`: also quadratic share 0 … 1, ground effect 0 … 25 % fading over 0.2 … 0.6 m, measurement delay 0 …
    40 ms, battery sag 0 … 3 %; every tenth in JSBSim, with gusts. `twin`: always the twin of the paper's drone. All
    uniform, all with the scatter of the paper's flights. Raises InputError for an unknown name.
    """
    if name not in _DRAWS:
        raise InputError(
            "There is no such population of vehicles.",
            hint=f"Choose one of: {', '.join(_DRAWS)}.",
            problems=(Problem("population", f"unknown name {name!r}"),),
        )
    place = list(_DRAWS).index(name)
    return tuple(_DRAWS[name](number, np.random.default_rng((seed, place, number))) for number in range(1, count + 1))


def _twin(number: int, _generator: np.random.Generator) -> SampledVehicle:
    return _sampled("twin", number, "twin", {})


def _four_parameter(number: int, generator: np.random.Generator) -> SampledVehicle:
    return _sampled("four-parameter", number, "twin", _simple(generator))


def _further_physics(number: int, generator: np.random.Generator) -> SampledVehicle:
    draw = generator.uniform
    simple = _simple(generator)
    if number % JSBSIM_EVERY == 0:
        mass_kg = draw(0.36, 0.42)
        return _sampled(
            "further-physics",
            number,
            "jsbsim",
            {
                "mass_kg": mass_kg,
                "thrust_scale": mass_kg * GRAVITY_M_S2 / (FULL_THRUST_N * simple["hover_throttle"]),
                "motor_lag_s": simple["motor_lag_s"],
                "start_latency_s": simple["start_latency_s"],
                "gust_m_s": draw(0.5, 2.0),
                "altitude_noise_m": draw(0.0, 0.01),
                "battery_sag": draw(0.0, 0.03),
            },
        )
    further = {
        "quadratic_share": draw(0.0, 1.0),
        "ground_effect": draw(0.0, 0.25),
        "ground_effect_height_m": draw(0.2, 0.6),
        "measurement_delay_s": draw(0.0, 0.04),
        "battery_sag": draw(0.0, 0.03),
    }
    return _sampled("further-physics", number, "twin", {**simple, **further})


def _simple(generator: np.random.Generator) -> dict[str, float]:
    draw = generator.uniform
    return {
        "hover_throttle": draw(0.45, 0.75),
        "motor_lag_s": draw(0.0, 0.1),
        "start_latency_s": draw(0.0, 0.4),
        "drag_1_s": draw(0.0, 0.4),
    }


def _sampled(name: str, number: int, kind: str, options: Mapping[str, float]) -> SampledVehicle:
    return SampledVehicle(population=name, number=number, kind=kind, options=check_options(kind, options))


_DRAWS: Final[Mapping[str, Callable[[int, np.random.Generator], SampledVehicle]]] = MappingProxyType(
    {"twin": _twin, "four-parameter": _four_parameter, "further-physics": _further_physics}
)


def fly(vehicle: SampledVehicle, gains: Gains, seed: int) -> Trajectory:
    """Fly one takeoff. A flight that diverges numerically has non-finite altitudes."""
    return trajectory_of(_rows(vehicle, gains, seed), vehicle.kind)


def noise_free_error(vehicle: SampledVehicle, gains: Gains) -> float:
    """The takeoff's error (m) without scatter, gusts or sensor noise; infinite if it diverges numerically."""
    altitude = _rows(vehicle.quiet, gains, seed=0)[: len(_TAKEOFF.grid_s), ALTITUDE]
    return float(_TAKEOFF.errors(altitude[np.newaxis])[0]) if np.isfinite(altitude).all() else float("inf")


def is_unsafe(trajectory: Trajectory) -> bool:
    """Whether a flight rose above 3.75 m, was below 2.25 m after the first 5 s, or has non-finite altitudes."""
    altitude: Samples = trajectory["altitude_m"]
    if not np.isfinite(altitude).all():
        return True
    settled = altitude[trajectory.time_s > SETTLED_S]
    return bool(altitude.max() > HIGHEST_M or (settled.size and settled.min() < LOWEST_M))


@dataclass(frozen=True, slots=True)
class Optimum:
    """The best gains found for a vehicle inside the default bounds, and their noise-free error (m)."""

    gains: Mapping[str, float]
    error: float


def own_optimum(vehicle: SampledVehicle) -> Optimum:
    """The gains in the default bounds with the lowest noise-free error.

    The optimum of the takeoff model closest to the vehicle is searched from many starts, then refined on the vehicle
    itself: over integer counts for twins; for JSBSim, which is a hundred times slower, by Nelder–Mead and coarser
    steps. The optimum is flat: the remaining error is below 0.4 % for twins.
    """
    space, (start, evaluations, coarsest, finest) = _TAKEOFF.space, _REFINEMENT[vehicle.kind]

    def error(gains: Vector) -> float:
        return noise_free_error(vehicle, space.mapping(space.nearest(gains)))

    best = _model_optimum(_model_of(vehicle))
    if evaluations:
        best = _descend(error, best, start, evaluations)
    best = _polish(error, space.nearest(best), coarsest, finest)
    return Optimum(space.mapping(best), error(best))


_REFINEMENT: Final[Mapping[str, tuple[float, int, float, float]]] = MappingProxyType(
    {"twin": (0.0, 0, 0.5, 0.002), "jsbsim": (0.5, 30, 0.25, 0.05)}
)
"""Refinement of the model's optimum on the vehicle: first step and flights of Nelder–Mead, then the coarsest and the
finest steps along each gain; steps as shares of the gain's scale."""


def _model_of(vehicle: SampledVehicle) -> Vector:
    """Parameters of the takeoff model closest to the vehicle, shape (m,)."""
    known = {name: float(value) for name, value in vehicle.options.items()}
    if vehicle.kind == "jsbsim":
        known["hover_throttle"] = known["mass_kg"] * GRAVITY_M_S2 / (FULL_THRUST_N * known["thrust_scale"])
    return np.array([known.get(parameter.name, 0.0) for parameter in _TAKEOFF.model_parameters])


def _model_optimum(model: Vector) -> Vector:
    """The model's best gains: Nelder–Mead from two known local optima and the best six of 128 Sobol points."""
    space = _TAKEOFF.space

    def errors(gains: Matrix) -> Vector:
        return _TAKEOFF.errors(_TAKEOFF.outputs(gains, model))

    def error(gains: Vector) -> float:
        return float(errors(space.nearest(gains)[np.newaxis])[0])

    sobol = space.lower + qmc.Sobol(len(space.gains), scramble=False).random(128) * (space.upper - space.lower)
    starts = np.concatenate((_VALLEYS, sobol[np.argsort(errors(sobol))[:6]]))
    ends = [_descend(error, start, 1.0, 150) for start in starts]
    return ends[int(np.argmin([error(end) for end in ends]))]


_VALLEYS: Final = np.array([[1600.0, 1023.0, 130.0], [3500.0, 1040.0, 220.0]])


def _descend(error: Callable[[Vector], float], start: Vector, step: float, evaluations: int) -> Vector:
    """Nelder–Mead with a first step of `step` times each gain's scale."""
    space = _TAKEOFF.space
    return minimise_in_box(
        error, start, step * space.scale, Box(space.lower, space.upper), evaluations=evaluations, tolerance=0.5
    )


def _polish(error: Callable[[Vector], float], start: Vector, coarsest: float, finest: float) -> Vector:
    """Coordinate search with steps from `coarsest` to `finest` of each gain's scale, halved when no step improves."""
    space = _TAKEOFF.space
    best, lowest, share = start, error(start), coarsest
    while share >= finest:
        steps = np.diag(np.maximum(np.rint(share * space.scale), 1.0))
        near = [space.nearest(best + step) for step in (*steps, *-steps)]
        errors = [error(each) for each in near]
        if min(errors) < lowest:
            lowest, best = min(errors), near[int(np.argmin(errors))]
        else:
            share /= 2.0
    return best


def _rows(vehicle: SampledVehicle, gains: Gains, seed: int) -> Rows:
    simulation = _SIMULATIONS[vehicle.kind]({name: float(value) for name, value in vehicle.options.items()}, seed)
    return simulate_flight(simulation, gains)
