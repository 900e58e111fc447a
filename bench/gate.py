"""Errors and computation time of the gate.

    ./dev exec python -m bench.gate [--sets 200] [--takeoffs 1000]

The gate judges random gain sets inside the default bounds. Each set is then flown in many takeoffs, aborted at random
instants, on vehicles drawn from the parameter distribution that the gate samples in its own way. Code independent of
the gate decides from the altitude curves of the experiment's model whether a takeoff is harmful: above the ceiling,
back on the ground after having come within half of the set point, further from it at the end than before, or with a
climb rate whose oscillation does not decay. Prints both kinds of error, before any flight and after one. Exits with 1
if a harmless set is refused or a verdict takes more than 0.15 s of processor time; where a takeoff of the model takes
longer than on the machine of that limit, the limit is raised in proportion.
"""

import argparse
import sys
import time
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import find_peaks

from app.core.control.vertical_guidance import RATE_HZ
from app.core.experiments.base import Check, Envelope, Matrix, ParameterDistribution, prior_distribution
from app.core.experiments.takeoff import SET_POINTS, Takeoff
from app.core.experiments.vertical_loop_hazards import (
    LARGEST_TOUCH_DOWN_M_S,
    SMALLEST_SWING_M_S,
    UNDAMPED,
    Manoeuvre,
    abort_steps,
    fly_runs,
)
from app.core.models.vertical import Counts
from app.core.models.vertical_hazards import HIGHEST_M, TOUCH_DOWN_M_S
from app.core.policy import Vector

LIMIT_S: Final = 0.15
TAKEOFF_S: Final = 0.5e-3
"""Processor time of a takeoff of the model on the machine of that limit."""
SEED: Final = 20260101
CEILING_M: Final = 4.5
SET_POINT_M: Final = 3.0
MANOEUVRE: Final = Manoeuvre(SET_POINTS, 16_693)
BATCH: Final = 100

TAKEOFF: Final = Takeoff()
SAFE: Final = TAKEOFF.space.mapping(TAKEOFF.space.default)
SAFE_COUNTS: Final[Counts] = TAKEOFF.space.default.astype(np.int64)


@dataclass(frozen=True, slots=True)
class Tally:
    """Counts of agreement and disagreement between the gate and the takeoffs."""

    refused_harmless: list[str]
    accepted_harmful: list[str]
    refused: int
    harmful: int
    slowest_s: float


def after_a_flight() -> ParameterDistribution:
    """Parameter distribution that is typical after one flight of the paper's drone."""
    mean = TAKEOFF.nominal_model
    mean[:3] = (0.61, 0.3, 0.05)
    sd = np.array([0.3 * parameter.known_within / 2.0 for parameter in TAKEOFF.model_parameters])
    return ParameterDistribution(
        mean=tuple(mean.tolist()), covariance=tuple(tuple(row) for row in np.diag(sd**2).tolist()), origin="one flight"
    )


def harm(gains: Vector, spread: ParameterDistribution, takeoffs: int, seed: int) -> str:
    """Return what the first harmful takeoff does; empty if none is harmful."""
    models = spread.models(TAKEOFF, np.random.default_rng(seed).random((takeoffs, len(spread.mean))))
    for first in range(0, takeoffs, BATCH):
        curves = TAKEOFF.outputs(np.tile(gains, (len(models[first : first + BATCH]), 1)), models[first : first + BATCH])
        for curve in curves:
            if found := _astray(curve) or _swinging(curve):
                return found
    return _aborted(gains.astype(np.int64), models, seed)


def _astray(altitude: Vector) -> str:
    if altitude.max() > CEILING_M:
        return f"rises to {altitude.max():.2f} m"
    near = np.flatnonzero(altitude >= 0.5 * SET_POINT_M)
    if not near.size:
        return ""
    if altitude[near[0] :].min() <= 0.0:
        return "falls to the ground"
    third = len(altitude) // 3
    away = np.abs(altitude - SET_POINT_M)
    middle, last = away[max(near[0], third) : 2 * third], away[max(near[0], 2 * third) :]
    if middle.size and last.max() > max(middle.max(), 0.5 * SET_POINT_M):
        return f"moves away, {last.max():.2f} m at the end"
    return ""


def _swinging(altitude: Vector) -> str:
    """Check the oscillation of the climb rate after the first third of the takeoff."""
    climb = np.diff(altitude) * RATE_HZ
    third = len(climb) // 3
    settled = climb[third:]
    if np.ptp(settled) < SMALLEST_SWING_M_S:
        return ""
    heights = [
        (place, sign * settled[place])
        for sign in (1.0, -1.0)
        for place in find_peaks(sign * settled, prominence=0.5 * SMALLEST_SWING_M_S)[0]
    ]
    # Heights of peaks and depths of troughs about their mean; the peak-to-peak amplitude is about the sum of the two.
    halves = [[height for place, height in heights if low <= place < low + third] for low in (0, third)]
    if any(len(half) < 2 for half in halves):
        return ""
    middle, last = (2.0 * float(np.mean(sorted(half)[-2:])) for half in halves)
    return (
        f"oscillates by {last:.2f} m/s after {middle:.2f}" if last > max(UNDAMPED * middle, SMALLEST_SWING_M_S) else ""
    )


def _aborted(gains: Counts, models: Matrix, seed: int) -> str:
    instants = np.random.default_rng(seed).uniform(0.3, 32.0, (len(models), 1))
    at = np.asarray(np.rint(instants * RATE_HZ), dtype=np.int64)
    aborts = fly_runs(gains, SAFE_COUNTS, models, at, MANOEUVRE).aborts[:, 0]
    beyond = (aborts > (CEILING_M, LARGEST_TOUCH_DOWN_M_S)).any(axis=1)
    if not beyond.any():
        return ""
    own = fly_runs(SAFE_COUNTS, SAFE_COUNTS, models[beyond], abort_steps(int(beyond.sum()), MANOEUVRE), MANOEUVRE)
    highest = np.maximum(own.aborts[:, :, HIGHEST_M].max(axis=1), own.reports[:, HIGHEST_M])
    fastest = own.aborts[:, :, TOUCH_DOWN_M_S].max(axis=1)
    harmful = (aborts[beyond, 0] > np.maximum(highest, CEILING_M)) | (
        aborts[beyond, 1] > np.maximum(fastest, LARGEST_TOUCH_DOWN_M_S)
    )
    return "an abort fails" if harmful.any() else ""


def judge(gains: Vector, spread: ParameterDistribution) -> tuple[tuple[Check, ...], float]:
    """Return the gate's checks of hazards and their processor time, s."""
    start = time.process_time()
    checks = TAKEOFF.hazards(gains, spread, Envelope(ceiling_m=CEILING_M, safe_gains=SAFE))
    return checks, time.process_time() - start


def slowness() -> float:
    """Return how much slower a takeoff of the model is than on the machine of the limit; at least 1."""
    gains, model = TAKEOFF.space.default[np.newaxis], TAKEOFF.nominal_model[np.newaxis]
    times = []
    for _ in range(100):
        start = time.process_time()
        TAKEOFF.outputs(gains, model)
        times.append(time.process_time() - start)
    return max(1.0, min(times) / TAKEOFF_S)


def compare(spread: ParameterDistribution, sets: int, takeoffs: int) -> Tally:
    random = np.random.default_rng(SEED)
    lower, upper = TAKEOFF.space.lower.astype(np.int64), TAKEOFF.space.upper.astype(np.int64)
    drawn = random.integers(lower, upper, endpoint=True, size=(sets, 3))
    judge(drawn[0].astype(float), spread)  # compiled
    tally = Tally([], [], 0, 0, 0.0)
    refused, harmful, slowest = 0, 0, 0.0
    for number, gains in enumerate(drawn.astype(float)):
        checks, seconds = judge(gains, spread)
        refusals = [check for check in checks if not check.passed]
        found = harm(gains, spread, takeoffs, SEED + number)
        refused, harmful, slowest = refused + bool(refusals), harmful + bool(found), max(slowest, seconds)
        if refusals and not found:
            tally.refused_harmless.append(f"{gains.astype(int).tolist()}: {refusals[0].sentence}")
        if found and not refusals:
            tally.accepted_harmful.append(f"{gains.astype(int).tolist()}: a takeoff {found}")
    return Tally(tally.refused_harmless, tally.accepted_harmful, refused, harmful, slowest)


def main() -> int:
    asked = argparse.ArgumentParser()
    asked.add_argument("--sets", type=int, default=40)
    asked.add_argument("--takeoffs", type=int, default=200)
    size = asked.parse_args()
    failed = False
    for spread in (prior_distribution(TAKEOFF), after_a_flight()):
        slow, tally = slowness(), compare(spread, size.sets, size.takeoffs)
        print(
            f"known from {spread.origin}: {size.sets} sets, {size.takeoffs} takeoffs each: {tally.refused} refused, "
            f"{tally.harmful} harmful; refused though harmless {len(tally.refused_harmless)}, accepted though harmful "
            f"{len(tally.accepted_harmful)}; slowest verdict {tally.slowest_s * 1e3:.0f} ms (limit "
            f"{LIMIT_S * 1e3:.0f} ms × {slow:.2f})"
        )
        for line in (*tally.refused_harmless, *tally.accepted_harmful):
            print(f"    {line}")
        failed |= bool(tally.refused_harmless) or tally.slowest_s > LIMIT_S * slow
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
