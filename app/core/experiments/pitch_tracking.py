"""The paper's F-16 experiment: track a sine in pitch for a minute, with a model that is off in every element."""

from collections.abc import Mapping
from typing import Final, Self

import numpy as np

from app.core.definition import Option, OptionValue, with_defaults
from app.core.experiments.base import (
    Check,
    Envelope,
    Matrix,
    ModelledExperiment,
    ModelParameter,
    ParameterDistribution,
    Scatter,
    SimplexSearch,
)
from app.core.models.f16 import (
    ALTITUDE,
    ANGLE_OF_ATTACK,
    ELEMENTS,
    ELEVATOR,
    LARGEST_ERROR_RAD,
    PITCH,
    PITCH_RATE,
    REFERENCE,
    SPEED,
    STATES,
    STEP_S,
    THRUST,
    perturbed,
    track,
    track_batch,
    transitions,
)
from app.core.policy import Gain, PolicySpace, Vector
from app.core.records.metrics import mean_absolute_error, require_scorable
from app.core.records.trajectory import Samples, Trajectory

WINDOW_S: Final = 60.0
OUTPUT: Final = "pitch_error_rad"

_SAMPLES: Final = round(WINDOW_S / STEP_S) + 1
_M_PER_FT: Final = 0.3048
_N_PER_LB: Final = 4.4482216152605

DETAIL_CHANNELS: Final[Mapping[str, tuple[int, float]]] = {
    "altitude_change_m": (ALTITUDE, _M_PER_FT),
    "pitch_rad": (PITCH, 1.0),
    "speed_change_m_s": (SPEED, _M_PER_FT),
    "angle_of_attack_rad": (ANGLE_OF_ATTACK, 1.0),
    "pitch_rate_rad_s": (PITCH_RATE, 1.0),
    "pitch_reference_rad": (REFERENCE, 1.0),
    "thrust_change_n": (THRUST, _N_PER_LB),
    "elevator_rad": (ELEVATOR, np.pi / 180.0),
}
"""Channels of a record besides the output: the column of a run's detail, and its unit in SI. Deviations from trim."""

_ROWS: Final = ("h", "Θ", "V", "α", "q")
_COLUMNS: Final = (*_ROWS, "F_T", "δ")


def _gain(name: str, title: str, unit: str, lower: float, upper: float, scale: float, default: float) -> Gain:
    return Gain(name, title, unit, lower=lower, upper=upper, scale=scale, default=default, integer=False)


def _parameters(perturbation: float) -> tuple[ModelParameter, ...]:
    return tuple(
        ModelParameter(
            f"ln_{'a' if column < STATES else 'b'}{row + 1}{column + 1 if column < STATES else column + 1 - STATES}",
            f"{'A' if column < STATES else 'B'}({_ROWS[row]}, {_COLUMNS[column]}) against the model",
            "ln ×",
            upper=2.5,
            prior_sd=0.35,
            known_within=perturbation,
            lower=-2.5,
        )
        for row, column in zip(*ELEMENTS, strict=True)
    )


class PitchTracking(ModelledExperiment):
    """Pitch tracking on an inaccurate model.

    The model is the true system with every element of A and B off by up to `perturbation`, drawn with `model_seed`; its
    parameters are the logarithms of factors on these elements.
    """

    name = "pitch-tracking"
    title = "Pitch tracking of an F-16"
    curves_title = "Pitch error curves"
    output = OUTPUT
    integrates = True
    error_unit = "rad·s"
    window_s = WINDOW_S
    measure = "pitch tracking"
    scatter = Scatter(sd=0.001, degrees_of_freedom=4.0)
    search = SimplexSearch(of_scale=0.5, iterations=300, bounded=False)
    difference = 0.001
    space = PolicySpace(
        (
            _gain("theta_1", "Thrust per speed", "lb·s/ft", -200.0, -20.0, 50.0, -50.0),
            _gain("theta_2", "Thrust offset", "lb", -50.0, 50.0, 100.0, 0.0),
            _gain("theta_3", "Elevator per pitch error", "deg/rad", -57.3, 0.0, 20.0, -15.0),
            _gain("theta_4", "Elevator per angle of attack", "deg/rad", -57.3, 57.3, 20.0, 0.0),
            _gain("theta_5", "Elevator per pitch rate", "deg·s/rad", -57.3, 57.3, 10.0, 10.0),
            _gain("theta_6", "Elevator offset", "deg", -5.0, 5.0, 1.0, 0.0),
        )
    )
    options = (
        Option(
            name="perturbation",
            title="Largest relative error of each element of the model",
            default=0.45,
            lower=0.0,
            upper=0.8,
        ),
        Option(name="model_seed", title="Seed that selects the inaccurate model", default=0, lower=0, upper=2**32 - 1),
    )

    def __init__(self, options: Mapping[str, OptionValue] | None = None) -> None:
        """`options` must be free of problems."""
        chosen = with_defaults(options or {}, self.options)
        perturbation = float(chosen["perturbation"])
        self._system: Final = perturbed(perturbation, int(chosen["model_seed"]))
        self.model_parameters = _parameters(perturbation)
        self._kept: tuple[bytes, Matrix] | None = None

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The experiment with another inaccurate model; settings missing in `options` have their defaults."""
        return type(self)(options)

    @property
    def grid_s(self) -> Samples:
        """Every 0.02 s for a minute, shape (3001,); as multiples of the step, which differ in the last bit."""
        return np.arange(_SAMPLES, dtype=np.float64) * STEP_S

    def systems(self, model: Matrix | Vector) -> Matrix:
        """[A | B] of model parameters (…, 19), in the source's units: shape (…, 5, 7)."""
        multipliers = np.zeros((*model.shape[:-1], *self._system.shape))
        rows, columns = ELEMENTS
        multipliers[..., rows, columns] = model
        return np.asarray(self._system * np.exp(multipliers))

    def _moves(self, model: Matrix | Vector) -> Matrix:
        """Transition matrices of one step, shape (k, 5, 7).

        A search evaluates the same model hundreds of times, so the last single model is cached.
        """
        if model.ndim > 1:
            return transitions(self.systems(model))
        key, kept = model.tobytes(), self._kept
        if kept is None or kept[0] != key:
            kept = self._kept = key, transitions(self.systems(model[np.newaxis]))
        return kept[1]

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One run of the model with every channel."""
        errors, detail = track(gains, transitions(self.systems(model)), _SAMPLES)
        return Trajectory(self.grid_s, named_channels(errors, detail), "model", "simulation")

    def outputs(self, gains: Matrix, model: Matrix) -> Matrix:
        """Pitch error of many policies, each on its own model or all on one: gains (k, 6) → (k, 3001)."""
        return track_batch(gains, self._moves(model), _SAMPLES)

    def disturbances(self, trajectory: Trajectory, gains: Vector, model: Vector) -> Matrix | None:  # noqa: ARG002
        """Difference of every recorded step from the model's, shape (3001, 5), in the source's units.

        The last row is zero, and so are all rows once the run has diverged. None if the record lacks a state or a
        command.
        """
        flown = states_and_commands(trajectory, self.grid_s)
        if flown is None:
            return None
        beyond: Matrix = flown[1:, :STATES] - flown[:-1] @ transitions(self.systems(model)).T
        diverged = np.abs(np.interp(self.grid_s, trajectory.time_s, trajectory[OUTPUT])) >= LARGEST_ERROR_RAD
        beyond[np.maximum.accumulate(diverged)[1:]] = 0.0
        return np.concatenate((beyond, np.zeros((1, STATES))))

    def disturbed_outputs(self, gains: Matrix, model: Matrix, disturbances: Matrix) -> Matrix:
        """`outputs` with `disturbances` added to the states after each step."""
        return track_batch(gains, self._moves(model), _SAMPLES, disturbances)

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:  # noqa: ARG002
        """No hazards beyond the bounds: this experiment is flown in simulation only."""
        return ()

    def errors(self, outputs: Matrix) -> Vector:
        """Integral of the absolute pitch error, rad·s, over a minute: (k, 3001) → (k,)."""
        return np.asarray(np.trapezoid(_counted(outputs), dx=STEP_S, axis=-1), dtype=np.float64)

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same for a recorded flight. Raises TrajectoryError if it has gaps or does not cover the minute."""
        require_scorable(trajectory, OUTPUT, 0.0, WINDOW_S, accept_gaps=accept_gaps)
        counted = _counted(trajectory[OUTPUT])
        return WINDOW_S * mean_absolute_error(trajectory.time_s, counted, self.set_point, 0.0, WINDOW_S)


def named_channels(errors: Samples, detail: Samples) -> dict[str, Samples]:
    """Channels of a run by name, in SI: pitch errors (n,) and detail (n, 8)."""
    named = {name: np.ascontiguousarray(detail[:, i]) * unit for name, (i, unit) in DETAIL_CHANNELS.items()}
    return {OUTPUT: errors} | named


def states_and_commands(trajectory: Trajectory, grid_s: Samples) -> Matrix | None:
    """[x | u] at the times `grid_s`, shape (n, 7), in the source's units; None if a channel is missing."""
    wanted = [(name, unit) for name, (i, unit) in DETAIL_CHANNELS.items() if i != REFERENCE]
    if any(name not in trajectory.channels for name, _ in wanted):
        return None
    return np.stack([np.interp(grid_s, trajectory.time_s, trajectory[name]) / unit for name, unit in wanted], axis=-1)


def _counted(errors: Matrix) -> Matrix:
    """Absolute errors; from the first that reaches the limit on, all count as the limit."""
    size = np.abs(errors)
    is_largest = size >= LARGEST_ERROR_RAD
    if not is_largest.any():
        return np.asarray(size)
    return np.where(np.maximum.accumulate(is_largest, axis=-1), LARGEST_ERROR_RAD, size)
