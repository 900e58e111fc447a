"""The second part of the check against a log of the vertical loop: the reference and the integrator evolve between its
samples, so they are simulated from the command on and compared within the stated tolerances.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.paparazzi.replica.loop_log import Counts, LoopLog
from app.core.control import vertical_guidance as loop
from app.core.records.trajectory import Overlay, Samples

SIMULATED: Final = ("z_ref", "zd_ref", "zdd_ref", "z_sum_err")
TIME_TOLERANCE_S: Final = 0.02
TOLERANCES: Final[Mapping[str, float]] = MappingProxyType(
    {"z_ref": 0.01, "zd_ref": 0.02, "zdd_ref": 0.1, "z_sum_err": 0.02}
)
"""Largest differences beyond those explained by 20 ms of time uncertainty, in m, m/s and m/s²; for the integrator as a
share of its largest value."""

UNITS: Final[Mapping[str, float]] = MappingProxyType({"z_ref": 1 / 256, "zd_ref": 1 / 2**19, "zdd_ref": 1 / 2**10})
"""Size of one count of each reference, in m, m/s and m/s²."""
_FIT_S: Final = 2.0
_MAX_STEPS: Final = loop.RATE_HZ * 120


@dataclass(frozen=True, slots=True)
class SimulationCheck:
    """Largest differences between log and simulation over `duration_s` from the command on, as in `TOLERANCES`.

    `overlay` has both sides of `SIMULATED` for every sample after the command, NaN where the integrator is not active.
    """

    command_s: float
    duration_s: float
    largest_difference: Mapping[str, float]
    overlay: Overlay

    @property
    def passed(self) -> bool:
        return all(value <= TOLERANCES[name] for name, value in self.largest_difference.items())


def compare_simulation(log: LoopLog) -> SimulationCheck | None:
    """Simulate the reference and the integrator from the first command that lasts two seconds.

    None if there is none: the loop is active from the first sample on, never, or only briefly.
    """
    found = _first_command(log)
    if found is None:
        return None
    first, last = found
    part = LoopLog(log.time_s[first : last + 1], log.values[first : last + 1])
    reference = _simulated_reference(part)
    steps, offset_s = _aligned(part, reference)
    outside: dict[str, Samples] = {
        name: np.float64(unit) * _outside(part[name], reference[:, place], steps)
        for place, (name, unit) in enumerate(UNITS.items())
    }
    integrator = _simulated_integrator(part, reference[:, 0], steps)
    largest = max(float(np.abs(part["z_sum_err"][1:][np.isfinite(integrator)]).max(initial=0.0)), 1.0)
    outside["z_sum_err"] = np.nan_to_num(np.abs(part["z_sum_err"][1:] - integrator) / largest)
    overlay = Overlay(
        part.time_s[1:],
        {name: part[name][1:] for name in SIMULATED},
        {**{name: reference[steps, place] for place, name in enumerate(UNITS)}, "z_sum_err": integrator},
        {name: values > TOLERANCES[name] for name, values in outside.items()},
    )
    return SimulationCheck(
        command_s=float(part.time_s[0]) + offset_s,
        duration_s=float(part.time_s[-1] - part.time_s[0]),
        largest_difference={name: float(values.max()) for name, values in outside.items()},
        overlay=overlay,
    )


def _first_command(log: LoopLog) -> tuple[int, int] | None:
    """Index of the last sample before the reference starts to move, and of the last one with the same set point."""
    idle = log.idle
    for first in np.flatnonzero(idle[:-1] & ~idle[1:]).tolist():
        same = (log["z_sp"] == log["z_sp"][first + 1]) & ~idle
        same &= log.time_s <= log.time_s[first] + _MAX_STEPS / loop.RATE_HZ
        broken = np.flatnonzero(~same[first + 1 :])
        last = first + int(broken[0]) if broken.size else len(log) - 1
        if log.time_s[last] - log.time_s[first] >= _FIT_S:
            return first, last
    return None


def _simulated_reference(part: LoopLog) -> Counts:
    """z_ref, zd_ref and zdd_ref of every step from the command on, at rest before it: shape (steps, 3)."""
    target, z, zd = -int(part["z_sp"][1]), int(part["z"][0]), int(part["zd"][0])
    state = loop.new_state(z, zd)
    rest = round((part.time_s[1] - part.time_s[0] + 2 * TIME_TOLERANCE_S) * loop.RATE_HZ)
    rows = [(z, zd, 0)] * rest
    for _ in range(round((part.time_s[-1] - part.time_s[0] + 2 * TIME_TOLERANCE_S) * loop.RATE_HZ)):
        loop.step(state, loop.ALT, target, 0, 0, 0, z, zd, loop.LEVEL, False)
        rows.append((state[loop.Z_REF], state[loop.ZD_REF], state[loop.ZDD_REF]))
    return np.array(rows, dtype=np.int64)


def _aligned(part: LoopLog, reference: Counts) -> tuple[NDArray[np.int64], float]:
    """Align the simulation with the log.

    Returns the simulated step of each sample after the command, shape (n − 1,), and the time from the last sample at
    rest to the command: where the references agree best over the first two seconds.
    """
    interval = part.time_s[1] - part.time_s[0]
    rest = round((interval + 2 * TIME_TOLERANCE_S) * loop.RATE_HZ)
    since = np.round((part.time_s[1:] - part.time_s[0]) * loop.RATE_HZ).astype(np.int64)
    early = since <= _FIT_S * loop.RATE_HZ
    latest = round((interval + TIME_TOLERANCE_S) * loop.RATE_HZ)
    shifts = range(-round(TIME_TOLERANCE_S * loop.RATE_HZ), latest + 1)

    def distance(shift: int) -> float:
        steps = np.clip(since[early] + rest - shift, 0, len(reference) - 1)
        return float(np.abs(part["zd_ref"][1:][early] - reference[steps, 1]).mean())

    best = min(shifts, key=distance)
    return np.clip(since + rest - best, 0, len(reference) - 1), best / loop.RATE_HZ


def _outside(logged: Counts, simulated: Counts, steps: NDArray[np.int64]) -> Counts:
    """How far the samples after the command lie outside the simulated range within 20 ms of them, shape (n − 1,)."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    window = 2 * round(TIME_TOLERANCE_S * loop.RATE_HZ) + 1
    low = minimum_filter1d(simulated, window, mode="nearest")[steps]
    high = maximum_filter1d(simulated, window, mode="nearest")[steps]
    outside: Counts = np.maximum(np.maximum(low - logged[1:], logged[1:] - high), 0)
    return outside


def _simulated_integrator(part: LoopLog, z_ref: Counts, steps: NDArray[np.int64]) -> Samples:
    """Summed error of the samples after the command, shape (n − 1,), from the first one with an active integrator.

    NaN before that sample, and everywhere if the integrator is never active. The position between samples is
    interpolated from positions and speeds. Of several samples in the same step only the first has a value; the others
    are NaN.
    """
    from scipy.interpolate import CubicHermiteSpline

    summed = np.full(len(steps), np.nan)
    working = np.flatnonzero(part["z_sum_err"][1:])
    begin = int(working[0]) if working.size else len(steps)
    since, first = np.unique(steps[begin:], return_index=True)
    if len(since) < 2:
        return summed
    rows = begin + 1 + first
    position = CubicHermiteSpline(since, part["z"][rows], part["zd"][rows] / 2**20)
    each = np.arange(since[0], since[-1] + 1)
    error = np.clip(z_ref[each] - position(each), -loop.POSITION_ERROR_MAX, loop.POSITION_ERROR_MAX)
    total, now = np.empty(len(each)), float(part["z_sum_err"][rows[0]])
    for step, value in enumerate(error.tolist()):
        if step:
            now = min(max(now + value, -loop.ERROR_SUM_MAX), loop.ERROR_SUM_MAX)
        total[step] = now
    summed[rows - 1] = total[since - since[0]]
    return summed
