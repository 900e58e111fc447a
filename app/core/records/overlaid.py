"""Recorded signals beside those of a replica, to be drawn."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.records.trajectory import Samples

Curve = tuple[float, ...]


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlaid:
    """One signal over time, recorded and from the replica, of equal length.

    `differing_s` and `differing` are time and value of each mark where the recorded signal differs.
    """

    label: str
    digits: int
    time_s: Curve
    recorded: Curve
    replica: Curve
    differing_s: Curve = ()
    differing: Curve = ()
