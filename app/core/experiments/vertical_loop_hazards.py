"""Hazards of a flight with a gain set, in simulated flights.

They are flown on the exact replica, over the vehicle's parameter distribution, with aborts. Mass has no parameter of
its own: it changes the ratio of thrust to weight, as the hover throttle does, whose distribution covers both.

A late release from the ground is not simulated: it overshoots with any integrating gains, and the vehicle's own check
for a timely lift-off protects against it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.control.vertical_guidance import RATE_HZ, STEP_S
from app.core.experiments.base import Check, Matrix, ModelParameter
from app.core.models.set_points import SetPoints
from app.core.models.vertical import START_LATENCY_S, Counts
from app.core.models.vertical_hazards import (
    DISTANCE_LAST_M,
    DISTANCE_MIDDLE_M,
    FALLEN_STEP,
    HIGHEST_M,
    HIGHEST_STEP,
    LOST_M,
    REPORT_SIZE,
    SWING_LAST_M_S,
    SWING_MIDDLE_M_S,
    TOUCH_DOWN_M_S,
    fly_with_aborts,
)
from app.core.policy import Vector
from app.core.records.trajectory import Samples

MODELS: Final = 32
"""Number of simulated vehicles: the likely one, and quasi-random ones around it."""

ABORTS_BETWEEN_S: Final = (0.3, 1.0, 1.7, 2.6, 4.0, 8.0)
"""Every flight is aborted once in each interval between these times and those of the later set points, and once between
the last of them and the last whole second of the flight, at a different time on every vehicle."""

LARGEST_TOUCH_DOWN_M_S: Final = 2.5
SMALLEST_SWING_M_S: Final = 0.1
"""A climb rate that swings by less counts as at rest."""
UNDAMPED: Final = 0.95
"""An oscillation must decay by more than 5 % from the middle third of the flight to the last."""

_CUT_OFF_M: Final = LOST_M - 0.2
"""Least report of a flight that was simulated no further: without its last step."""

_GOLDEN: Final = 0.6180339887498949


@dataclass(frozen=True, slots=True)
class Runs:
    """Flights of one gain set: models (k, m), abort steps (k, a), and the kernels' reports (k, 7) and (k, a, 2)."""

    models: Matrix
    abort_steps: Counts
    reports: Matrix
    aborts: Samples


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """A flight to simulate: its set points, its length in steps of the loop, and what it is called."""

    set_points: SetPoints
    steps: int
    noun: str = "takeoff"


def abort_steps(models: int, manoeuvre: Manoeuvre) -> Counts:
    """Abort times of flights, in steps, shape (models, a), increasing in each row; they cover each interval evenly."""
    later = (time_s for time_s in manoeuvre.set_points.times_s if time_s > ABORTS_BETWEEN_S[-1])
    edges = np.array((*ABORTS_BETWEEN_S, *later, (manoeuvre.steps - 1) // RATE_HZ))
    shares = (np.arange(models)[:, np.newaxis] + 1.0) * _GOLDEN % 1.0
    return np.asarray(np.rint((edges[:-1] + shares * np.diff(edges)) * RATE_HZ), dtype=np.int64)


def fly_runs(gains: Counts, safe_gains: Counts, models: Matrix, aborts_at: Counts, manoeuvre: Manoeuvre) -> Runs:
    """Simulate the manoeuvre on each model, and its aborts to `safe_gains`."""
    targets = manoeuvre.set_points.targets
    reports = np.empty((len(models), REPORT_SIZE))
    aborts = np.empty((*aborts_at.shape, 2))
    curves = np.empty((2, 2, manoeuvre.steps))
    for model, at, report, abort in zip(models, aborts_at, reports, aborts, strict=True):
        fly_with_aborts(gains, model, targets, safe_gains, at, curves, report, abort)
    return Runs(models, aborts_at, reports, aborts)


def check_flights(
    gains: Counts,
    safe_gains: Counts,
    baseline: bool,
    parameters: Sequence[ModelParameter],
    models: Matrix,
    ceiling_m: float,
    manoeuvre: Manoeuvre,
) -> tuple[Check, ...]:
    """Check altitude, divergence, oscillation and aborts of one gain set over `models`, shape (k, m).

    A `baseline` is never refused for its altitude. An abort switches to the safe gains: what these would do by
    themselves on the same vehicle is not held against the gains under test.
    """
    aborts_at = abort_steps(len(models), manoeuvre)
    runs = fly_runs(gains, safe_gains, models, aborts_at, manoeuvre)
    limits = np.array([ceiling_m, LARGEST_TOUCH_DOWN_M_S])
    allowed = np.tile(limits, (len(models), 1))
    beyond = (runs.aborts > limits).any(axis=(1, 2))
    if beyond.any():
        own = fly_runs(safe_gains, safe_gains, models[beyond], aborts_at[beyond], manoeuvre)
        highest_m = np.maximum(own.aborts[:, :, HIGHEST_M].max(axis=1), own.reports[:, HIGHEST_M])
        fastest_m_s = own.aborts[:, :, TOUCH_DOWN_M_S].max(axis=1)
        allowed[beyond] = np.maximum(limits, np.column_stack([highest_m, fastest_m_s]))
    return (
        _altitude(runs, parameters, ceiling_m, manoeuvre.noun, baseline),
        _divergence(runs, parameters, manoeuvre.set_points.altitudes_m[-1], manoeuvre.noun),
        _oscillation(runs, parameters, manoeuvre.noun),
        _abort(HIGHEST_M, runs, allowed, limits, parameters),
        _abort(TOUCH_DOWN_M_S, runs, allowed, limits, parameters),
    )


def divergence_distance(reports: Matrix, set_point_m: float) -> Vector:
    """Distance from the set point of each flight that fell back to the ground or still moves away at its end.

    Zero for the others: (k, 7) → (k,).
    """
    middle, last = reports[:, DISTANCE_MIDDLE_M], reports[:, DISTANCE_LAST_M]
    moves_away = (last > middle) & (last > 0.5 * set_point_m)
    return np.where(reports[:, FALLEN_STEP] >= 0.0, set_point_m, np.where(moves_away, last, 0.0))


def undamped_swing(reports: Matrix) -> Vector:
    """Swing of the climb rate in the last third of each flight, m/s, if it has not decayed since the middle third.

    Zero if it has, or if the vehicle is at rest: (k, 7) → (k,).
    """
    middle, last = reports[:, SWING_MIDDLE_M_S], reports[:, SWING_LAST_M_S]
    return np.where((middle > 0.0) & (last >= UNDAMPED * middle), last, 0.0)


def _altitude(runs: Runs, parameters: Sequence[ModelParameter], ceiling_m: float, noun: str, baseline: bool) -> Check:
    worst = int(np.argmax(runs.reports[:, HIGHEST_M]))
    highest_m = float(runs.reports[worst, HIGHEST_M])
    event = "highest" if highest_m < _CUT_OFF_M else f"above {LOST_M:.0f} m"
    case = _case(parameters, runs.models[worst], float(runs.reports[worst, HIGHEST_STEP]), event)
    passed = baseline or highest_m <= ceiling_m
    sentence = f"The highest of {len(runs.models)} simulated {noun}s {_rises(highest_m)}" + (
        f", with {case}; at most {ceiling_m:.2f} m is allowed."
        if not passed
        else f"; {ceiling_m:.2f} m is allowed."
        if highest_m <= ceiling_m
        else f", beyond {ceiling_m:.2f} m; these gains are allowed all the same, because every flight is compared with "
        "them."
    )
    return Check("altitude", passed, sentence, worst=highest_m, limit=ceiling_m, case=case)


def _rises(highest_m: float) -> str:
    """How high a simulated vehicle rises, as far as it is simulated."""
    if highest_m >= _CUT_OFF_M:
        return f"rises above {LOST_M:.0f} m, where the simulation ends"
    return f"rises to {highest_m:.2f} m"


def _divergence(runs: Runs, parameters: Sequence[ModelParameter], set_point_m: float, noun: str) -> Check:
    distances = divergence_distance(runs.reports, set_point_m)
    worst = int(np.argmax(distances))
    distance_m, fallen_step = float(distances[worst]), float(runs.reports[worst, FALLEN_STEP])
    if distance_m == 0.0:
        sentence = f"No simulated {noun} falls back to the ground or diverges from the set point."
        return Check("divergence", True, sentence, worst=0.0, limit=0.0)
    fallen = fallen_step >= 0.0
    case = _case(parameters, runs.models[worst], fallen_step, "on the ground again") if fallen else ""
    case = case or _case(parameters, runs.models[worst])
    did = "falls back to the ground" if fallen else f"ends {distance_m:.2f} m from the set point and diverges"
    return Check("divergence", False, f"A simulated {noun} {did}, with {case}.", distance_m, 0.0, case=case)


def _oscillation(runs: Runs, parameters: Sequence[ModelParameter], noun: str) -> Check:
    swings = undamped_swing(runs.reports)
    worst = int(np.argmax(swings))
    swing_m_s = float(swings[worst])
    if swing_m_s <= SMALLEST_SWING_M_S:
        sentence = f"Every simulated {noun} settles, or its oscillation decays."
        return Check("oscillation", True, sentence, worst=swing_m_s, limit=SMALLEST_SWING_M_S)
    case = _case(parameters, runs.models[worst])
    before_m_s = float(runs.reports[worst, SWING_MIDDLE_M_S])
    sentence = (
        f"The climb rate oscillates by {swing_m_s:.2f} m/s in the last third of a simulated {noun}, after "
        f"{before_m_s:.2f} m/s in the middle third: it does not decay, with {case}."
    )
    return Check("oscillation", False, sentence, worst=swing_m_s, limit=SMALLEST_SWING_M_S, case=case)


_ABORTS: Final = {
    HIGHEST_M: ("abort altitude", "m"),
    TOUCH_DOWN_M_S: ("abort touch-down", "m/s"),
}
"""Name and unit of the check of each reported value of an abort."""


def _abort(place: int, runs: Runs, allowed: Matrix, limits: Vector, parameters: Sequence[ModelParameter]) -> Check:
    """Check the abort that exceeds the most what is `allowed` for its vehicle, shape (k, 2): the limit, or beyond it
    what the safe gains do."""
    name, unit = _ABORTS[place]
    values = runs.aborts[:, :, place]
    excess = values - allowed[:, [place]]
    run, instant = divmod(int(np.argmax(excess)), excess.shape[1])
    value, limit = float(values[run, instant]), float(allowed[run, place])
    passed = value <= limit
    case = _case(parameters, runs.models[run], float(runs.abort_steps[run, instant]), "aborted")
    why = "" if limit == limits[place] else ", as with the safe gains"
    does = _rises(value) if place == HIGHEST_M else f"touches down at {value:.2f} {unit}"
    sentence = f"After an abort the vehicle {does} in the worst case; {limit:.2f} {unit} is "
    sentence += f"allowed{why}." if passed else f"allowed{why}: {case}."
    return Check(name, passed, sentence, worst=value, limit=limit, case=case)


def _case(parameters: Sequence[ModelParameter], model: Vector, step: float | None = None, event: str = "") -> str:
    """Description of the vehicle, and the time of the event, counted from the command."""
    parts = [
        f"{parameter.title.lower()} {short_value(value, parameter.unit)}"
        for parameter, value in zip(parameters, model.tolist(), strict=True)
        if value or parameter.nominal
    ]
    if step is not None:
        parts.append(f"{event} at {model[START_LATENCY_S] + step * STEP_S:.1f} s")
    return ", ".join(parts)


def short_value(value: float, unit: str) -> str:
    """Two significant digits; times below 0.1 s in milliseconds, to a tenth."""
    if unit == "s" and abs(value) < 0.1:
        return f"{1e3 * value:.{1 if abs(value) < 0.01 else 0}f} ms"
    return f"{value:.2g}{f' {unit}' if unit in {'s', '1/s', 'm'} else ''}"
