"""Glitch detection: jumps that no vehicle can fly, frozen samples, gaps, and disagreement between two sources.

Only the scored output is checked, from the command to the end of the scored window. The raw record is never altered:
`repaired` returns a copy. Constant samples on the ground are not frozen. Constant samples in the air count as frozen
only with further evidence: the climb rate shows that the vehicle moved, the output jumps at their end, or the climb
rate is constant too, which never happens in flight.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from app.core.records.flight_events import AIRBORNE_M
from app.core.records.metrics import MAX_GAP_S, MAX_STORED_GAP_S, find_problem
from app.core.records.trajectory import Samples, Trajectory


class ScoredOutput(Protocol):
    """What is read of an experiment: the name of its scored output, and the times (s) at which it is scored."""

    @property
    def output(self) -> str: ...
    @property
    def grid_s(self) -> Samples: ...


Kind = Literal["acceleration", "frozen", "gap", "disagreement"]


@dataclass(frozen=True, slots=True)
class Glitch:
    """`start_s` is the time of the last good sample before the glitch, `end_s` of the first good one after it."""

    kind: Kind
    start_s: float
    end_s: float
    sentence: str


_ALTITUDE: Final = "altitude_m"
"""The output whose physical limits are known. Others, such as a pitch error, are checked for gaps only."""
_SECOND_ALTITUDE: Final = "altitude_2_m"
_LARGEST_ACCELERATION_M_S2: Final = 30.0
"""Upward, this takes a thrust of four times the weight; downward, gravity alone gives a third of it."""
_SMALLEST_JUMP_M: Final = 0.1
"""The smallest that is distinguishable from noise."""
_FROZEN_S: Final = 0.3
_AROUND_S: Final = 0.15
"""Half width of the window in which the speed around a sample is measured."""
_SD_OF_MEDIAN: Final = 1.4826
"""Ratio of a normal distribution's standard deviation to its median absolute deviation."""
_OUT_OF_NOISE: Final = 7.0
_LONGEST_EXCURSION_S: Final = 1.5
"""Two jumps that cancel each other within this time are one glitch, with everything between them."""
_DISAGREEMENT: Final = 0.25
_DISAGREEMENT_S: Final = 0.1

Marks = list[tuple[int, int]]
"""Glitches as pairs of sample indices: the last good one before, and the first good one after."""


def find_glitches(experiment: ScoredOutput, trajectory: Trajectory) -> tuple[Glitch, ...]:
    """Find the glitches of a record, ordered by time.

    A record without the scored output, or whose times do not increase, has none: scoring reports what is wrong with it.
    """
    if find_problem(trajectory, experiment.output) is not None:
        return ()
    scored = (trajectory.time_s >= 0.0) & (trajectory.time_s <= experiment.grid_s[-1] + MAX_GAP_S)
    if np.count_nonzero(scored) < 3:
        return ()
    time_s = trajectory.time_s[scored]
    channels = {name: values[scored] for name, values in trajectory.channels.items() if len(values) == len(scored)}
    gaps = [(int(i), int(i) + 1) for i in np.flatnonzero(np.diff(time_s) > MAX_STORED_GAP_S)]
    found = [_gap(time_s, first, last) for first, last in gaps]
    if experiment.output == _ALTITUDE:
        altitude = channels[_ALTITUDE]
        excess = _excess(time_s, altitude)
        frozen = _frozen(time_s, altitude, channels.get("climb_rate_m_s"), excess)
        found.extend(_held(time_s, altitude, mark) for mark in frozen)
        others = [*gaps, *frozen]
        jumps = [
            mark for mark in _jumps(time_s, excess) if all(mark[1] < first or mark[0] > last for first, last in others)
        ]
        found.extend(_jumped(time_s, altitude, mark) for mark in jumps)
        if _SECOND_ALTITUDE in channels:
            found.extend(_disagreements(time_s, altitude, channels[_SECOND_ALTITUDE]))
    return tuple(sorted(found, key=lambda glitch: (glitch.start_s, glitch.kind)))


def repaired(experiment: ScoredOutput, trajectory: Trajectory, glitches: tuple[Glitch, ...]) -> Trajectory:
    """A copy of the record with the scored output interpolated linearly across each glitch.

    The line runs from the last good sample before the glitch to the first one after it.
    """
    values = trajectory[experiment.output].copy()
    time_s = trajectory.time_s
    for glitch in glitches:
        bad = (time_s > glitch.start_s) & (time_s < glitch.end_s)
        good = ~bad
        if bad.any() and good.any():
            values[bad] = np.interp(time_s[bad], time_s[good], values[good])
    return replace(trajectory, channels={**trajectory.channels, experiment.output: values})


def _gap(time_s: Samples, first: int, last: int) -> Glitch:
    missing_s = time_s[last] - time_s[first]
    sentence = f"No samples for {missing_s:.2f} s after {time_s[first]:.2f} s."
    return Glitch("gap", float(time_s[first]), float(time_s[last]), sentence)


def _held(time_s: Samples, altitude: Samples, mark: tuple[int, int]) -> Glitch:
    first, last = mark
    sentence = (
        f"The same {altitude[first]:.2f} m for {time_s[last - 1] - time_s[first]:.2f} s from "
        f"{time_s[first]:.2f} s on: no vehicle in the air is that steady."
    )
    return Glitch("frozen", float(time_s[first]), float(time_s[last]), sentence)


def _jumped(time_s: Samples, altitude: Samples, mark: tuple[int, int]) -> Glitch:
    first, last = mark
    lasts = "" if last == first + 1 else f", and back {time_s[last] - time_s[first]:.2f} s later"
    sentence = (
        f"A jump of {altitude[first + 1] - altitude[first]:+.2f} m at {time_s[first + 1]:.2f} s{lasts}: no "
        "thrust can accelerate a vehicle that much."
    )
    return Glitch("acceleration", float(time_s[first]), float(time_s[last]), sentence)


def _excess(time_s: Samples, altitude: Samples) -> Samples:
    """How far each step exceeds what the speed around it explains, shape (n − 1,); zero within the allowed range.

    The speed is the median of the steps within 0.15 s (of two on either side, where samples are sparser), and may
    change by the largest acceleration over that window. In a noisy record a jump must also exceed the noise of the
    steps.
    """
    from scipy.ndimage import median_filter

    duration_s, step = np.diff(time_s), np.diff(altitude)
    reach = max(2, round(_AROUND_S / float(np.median(duration_s))))
    beyond = step - median_filter(step / duration_s, size=2 * reach + 1, mode="nearest") * duration_s
    window_s = np.maximum(duration_s, reach * float(np.median(duration_s)))
    noise = _SD_OF_MEDIAN * float(np.median(np.abs(beyond)))
    allowed = max(_SMALLEST_JUMP_M, _OUT_OF_NOISE * noise) + _LARGEST_ACCELERATION_M_S2 * window_s * duration_s
    return np.where(np.abs(beyond) > allowed, beyond, 0.0)


def _jumps(time_s: Samples, excess: Samples) -> Marks:
    """Jumps, each from the sample before to the one after; jumps that cancel each other are merged into one."""
    steps = np.flatnonzero(excess).tolist()
    marks: Marks = []
    while steps:
        first = steps.pop(0)
        gone, last = float(excess[first]), first
        for place, step in enumerate(steps):
            if time_s[step + 1] - time_s[first] > _LONGEST_EXCURSION_S:
                break
            gone += float(excess[step])
            if abs(gone) < 0.5 * abs(float(excess[first])):
                last, steps = step, steps[place + 1 :]
                break
        marks.append((first, last + 1))
    return marks


def _frozen(time_s: Samples, altitude: Samples, rate: Samples | None, excess: Samples) -> Marks:
    """Runs of one constant value in the air during which the vehicle moved."""
    marks: Marks = []
    for first, last in _runs(np.diff(altitude) == 0.0):
        held_s = time_s[last] - time_s[first]
        in_the_air = altitude[first] > altitude[0] + AIRBORNE_M
        if held_s < _FROZEN_S or not in_the_air:
            continue
        during = slice(first, last + 1)
        moved = rate is not None and abs(float(np.trapezoid(rate[during], time_s[during]))) > _SMALLEST_JUMP_M
        rate_held = rate is not None and not np.ptp(rate[during])
        jumped = last < len(excess) and excess[last] != 0.0
        if moved or rate_held or jumped:
            marks.append((first, min(last + 1, len(altitude) - 1)))
    return marks


def _disagreements(time_s: Samples, altitude: Samples, second: Samples) -> Iterator[Glitch]:
    """Intervals in which two sources differ by more than their usual offset (that of their datums)."""
    apart = altitude - second
    apart = np.abs(apart - np.median(apart))
    for first, last in _runs((apart > _DISAGREEMENT)[1:]):
        before, after = first, min(last + 1, len(altitude) - 1)
        if time_s[after] - time_s[before] < _DISAGREEMENT_S:
            continue
        sentence = (
            f"The two sources differ by up to {apart[before + 1 : last + 1].max():.2f} m more than "
            f"elsewhere, from {time_s[before]:.2f} to {time_s[after]:.2f} s."
        )
        yield Glitch("disagreement", float(time_s[before]), float(time_s[after]), sentence)


def _runs(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and past-the-end index of each run of true flags; the flags have shape (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return ((int(first), int(last)) for first, last in edges.reshape(-1, 2))
