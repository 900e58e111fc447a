"""Trajectories: the samples of a flight or a model run, and their reduction for plotting; signals beside a replica's.

Records keep their peaks and shape (MinMaxLTTB, Van Der Donckt et al., 2023); smooth curves keep the samples at which
they bend (Ramer, 1972; Douglas and Peucker, 1973).
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.float64]

with (Path(__file__).parent / "channels.csv").open(encoding="ascii", newline="") as _rows:
    CHANNEL_UNITS: Final[Mapping[str, str]] = MappingProxyType(
        {row["channel"]: row["unit"] for row in csv.DictReader(_rows)}
    )
"""Known channels and their units.

Thrust and its two parts are shares of full command (the autopilot's 9600 counts), recorded with every sample. Throttle
is that share as a vehicle reports it, rarely and in whole percent: for display only, not to fit a model to. Those of an
aircraft in flight (angle of attack, altitude and speed change, pitch, thrust change, elevator) are deviations from
trimmed flight.
"""

THROTTLE_HOLDS_S: Final = 4.0
"""Longest time for which a reported throttle holds: three periods of Paparazzi, which reports it every 1.3 s."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Samples of one flight, altitude up, time in seconds since the command (earlier samples are negative).

    `time_s` has shape (n,) and increases strictly; every channel has shape (n,). `source` names what measured it
    (`jsbsim`, `twin`, `csv`, …), `clock` the origin of the time stamps (`simulation`, `vehicle`, `ground`).
    """

    time_s: Samples
    channels: Mapping[str, Samples]
    source: str
    clock: str

    def __getitem__(self, channel: str) -> Samples:
        return self.channels[channel]

    def __len__(self) -> int:
        return len(self.time_s)

    def as_stored(self) -> "Trajectory":
        """The trajectory as the database returns it: every number rounded to single precision."""
        channels = {name: _single(values) for name, values in self.channels.items()}
        return replace(self, time_s=_single(self.time_s), channels=channels)


def _single(values: Samples) -> Samples:
    return values.astype(np.float32).astype(np.float64)


Indices = NDArray[np.uint64]


def select_samples(time_s: Samples, values: Samples, points: int) -> Indices:
    """Indices of at most `points` samples, shape (k,), in order, including the first and the last."""
    if len(time_s) <= points:
        return np.arange(len(time_s), dtype=np.uint64)
    from tsdownsample import MinMaxLTTBDownsampler

    downsampler = MinMaxLTTBDownsampler()  # type: ignore[no-untyped-call]  # the library has no types
    chosen: Indices = downsampler.downsample(np.ascontiguousarray(time_s), np.ascontiguousarray(values), n_out=points)
    return chosen


def select_bends(time_s: Samples, values: Samples, tolerance: float) -> Indices:
    """Indices of samples, shape (k,), in order, whose polyline passes every other sample within `tolerance`.

    `tolerance` is in the unit of the values. The first and the last sample are included. The times must increase.
    """
    if len(time_s) < 3:
        return np.arange(len(time_s), dtype=np.uint64)
    needed = {0, len(time_s) - 1}
    spans = [(0, len(time_s) - 1)]
    while spans:
        first, last = spans.pop()
        ends = [first, last]
        off = np.abs(values[first:last] - np.interp(time_s[first:last], time_s[ends], values[ends]))
        furthest = first + int(np.argmax(off))
        if off[furthest - first] > tolerance:
            needed.add(furthest)
            spans += [(first, furthest), (furthest, last)]
    return np.array(sorted(needed), dtype=np.uint64)


@dataclass(frozen=True, slots=True)
class Overlay:
    """Recorded and replicated signals of the same samples.

    `time_s` has shape (n,); `recorded` and `replica` hold each signal by name, shape (n,). `differs` marks the samples
    without an explanation.
    """

    time_s: Samples
    recorded: Mapping[str, Samples | NDArray[np.int64]]
    replica: Mapping[str, Samples | NDArray[np.int64]]
    differs: Mapping[str, NDArray[np.bool_]]
