"""Parts of a logged flight that can be analysed: rows that follow each other without a gap, a jump or a change."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.recording import LONGEST_INTERVAL_S, ParameterHistory, Parameters, Refused, Rows
from app.core.records.trajectory import Samples

SHORTEST_PART_S: Final = 4.0
LONGEST_FLIGHT_S: Final = 120.0
LARGEST_LEAN: Final = 0.866
"""Cosine of the lean beyond which rows are left out: 30°."""
_INTERVAL_S: Final = 0.1
_ALREADY_THIN: Final = 0.9

Part = tuple[int, int]
"""First row, and the row after the last."""


Condition = tuple[Rows, str, str]
"""Rows that can be used, shape (n,), and the field and the reason of a refusal if there are none."""


def jumps(time_s: Samples, values: Samples, rates: Samples, largest: float) -> Rows:
    """Rows, shape (n,), whose value differs by more than `largest` from what its rate made of the one before."""
    followed = 0.5 * (rates[1:] + rates[:-1]) * np.diff(time_s)
    return np.append(False, np.abs(np.diff(values) - followed) > largest)


def find_parts(time_s: Samples, usable: Rows, begins: Rows, cuts_s: Sequence[float]) -> list[Part]:
    """Parts of usable rows that last long enough; a part also ends before a row of `begins` and at each of `cuts_s`.

    `time_s`, shape (n,), increases, and `cuts_s` does too.
    """
    rows = np.flatnonzero(usable)
    if not rows.size:
        return []
    apart = (np.diff(rows) > 1) | (np.diff(time_s[rows]) > LONGEST_INTERVAL_S) | begins[rows[1:]]
    apart |= np.diff(np.searchsorted(cuts_s, time_s[rows], side="right")) > 0
    ends = [*np.flatnonzero(apart).tolist(), len(rows) - 1]
    firsts = [0, *(end + 1 for end in ends[:-1])]
    parts = [(int(rows[first]), int(rows[end]) + 1) for first, end in zip(firsts, ends, strict=True)]
    return [(first, end) for first, end in parts if time_s[end - 1] - time_s[first] >= SHORTEST_PART_S]


class Manoeuvres:
    """How much the reference manoeuvres: its squared acceleration summed over time, which is what a fit learns from."""

    def __init__(self, time_s: Samples, acceleration_m_s2: Samples) -> None:
        self._time_s = time_s
        self._sum = np.append(
            0.0, np.cumsum(np.nan_to_num(acceleration_m_s2) ** 2 * np.diff(time_s, prepend=time_s[0]))
        )

    def within(self, part: Part) -> float:
        """Sum over a part."""
        first, end = part
        return float(self._sum[end] - self._sum[first])

    def richest(self, part: Part, lasts_s: float) -> Part:
        """The stretch of at most `lasts_s` with the largest sum; the part itself if it is not longer."""
        first, end = part
        ends = np.searchsorted(self._time_s[first:end], self._time_s[first:end] + lasts_s, side="right") + first
        sums = self._sum[ends] - self._sum[first:end]
        best = first + int(np.argmax(sums))
        return best, int(ends[best - first])

    def choose(self, parts: Sequence[Part]) -> list[Part]:
        """As many parts as fit into the longest flight, in order, those with most manoeuvres first; a longer one is
        shortened."""
        chosen: list[Part] = []
        left_s = LONGEST_FLIGHT_S
        for part in sorted(parts, key=self.within, reverse=True):
            first, end = self.richest(part, left_s)
            duration_s = float(self._time_s[end - 1] - self._time_s[first])
            if duration_s >= SHORTEST_PART_S:
                chosen.append((first, end))
                left_s -= duration_s
        return sorted(chosen)


def choose_parts(
    time_s: Samples,
    conditions: Sequence[Condition],
    begins: Rows,
    history: ParameterHistory,
    acceleration_m_s2: Samples,
    refused: Refused,
    none_found: tuple[str, str],
    bounds: Mapping[str, tuple[float, float]],
    absent: Callable[[str], str],
) -> tuple[Parameters, list[Part]]:
    """The parts to analyse, under the parameters of the one with most manoeuvres, and these parameters.

    Signals have shape (n,), `acceleration_m_s2` is that of the reference. Raises what `refused` makes of the field and
    the reason of the first condition that leaves no row, or of `none_found` if no part is long enough; and of a gain in
    `bounds` that is missing, for the reason that `absent` gives, or not positive where the search has no zero.
    """
    usable = np.ones(len(time_s), dtype=np.bool_)
    for condition, field, reason in conditions:
        usable &= condition
        if not usable.any():
            raise refused(field, reason)
    parts = find_parts(time_s, usable, begins, history.times_s)
    if not parts:
        raise refused(*none_found)
    manoeuvres = Manoeuvres(time_s, acceleration_m_s2)
    given = history.at(float(time_s[max(parts, key=manoeuvres.within)[0]]))
    for each, (least, _) in bounds.items():
        if each not in given:
            raise refused(each, absent(each))
        if given[each] < 0.0 or (least and not given[each]):
            raise refused(each, f"must be positive, got {given[each]:g}")
    return given, manoeuvres.choose([part for part in parts if history.at(float(time_s[part[0]])) == given])


def thinned(time_s: Samples, part: Part) -> NDArray[np.int64]:
    """Rows of a part at about ten a second or fewer, as vehicles log them by default."""
    first, end = part
    if np.median(np.diff(time_s[first:end])) >= _ALREADY_THIN * _INTERVAL_S:
        return np.arange(first, end)
    tenths = np.floor((time_s[first:end] - time_s[first]) / _INTERVAL_S + 0.5)
    return first + np.flatnonzero(np.diff(tenths, prepend=-1.0) > 0.0)
