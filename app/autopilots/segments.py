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

    `time_s`, shape (n,), increases, and `cuts_s` does too; there are usable rows.
    """
    rows = np.flatnonzero(usable)
    apart = (np.diff(rows) > 1) | (np.diff(time_s[rows]) > LONGEST_INTERVAL_S) | begins[rows[1:]]
    apart |= np.diff(np.searchsorted(cuts_s, time_s[rows], side="right")) > 0
    parts = [(int(part[0]), int(part[-1]) + 1) for part in np.split(rows, np.flatnonzero(apart) + 1)]
    return [(first, end) for first, end in parts if time_s[end - 1] - time_s[first] >= SHORTEST_PART_S]


def _richest(time_s: Samples, sums: Samples, part: Part, lasts_s: float) -> Part:
    """The stretch of a part of at most `lasts_s` in which `sums`, shape (n + 1,), grow the most; the part itself if it
    is not longer."""
    first, end = part
    ends = np.searchsorted(time_s[first:end], time_s[first:end] + lasts_s, side="right") + first
    best = first + int(np.argmax(sums[ends] - sums[first:end]))
    return best, int(ends[best - first])


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
    """The parts to analyse, under the parameters of the one with most manoeuvres, and these parameters: as many as fit
    into the longest flight, in order, those with most manoeuvres first; a longer one is shortened.

    Signals have shape (n,). `acceleration_m_s2` is that of the reference: how much it manoeuvres is its square, summed
    over time, which is what a fit learns from. Raises what `refused` makes of the field and the reason of the first
    condition that leaves no row, or of `none_found` if no part is long enough; and of a gain in `bounds` that is
    missing, for the reason that `absent` gives, or not positive where the search has no zero.
    """
    usable = np.ones(len(time_s), dtype=np.bool_)
    for condition, field, reason in conditions:
        usable &= condition
        if not usable.any():
            raise refused(field, reason)
    parts = find_parts(time_s, usable, begins, history.times_s)
    if not parts:
        raise refused(*none_found)
    squares = np.nan_to_num(acceleration_m_s2) ** 2
    sums = np.append(0.0, np.cumsum(squares * np.diff(time_s, prepend=time_s[0])))
    parts.sort(key=lambda part: float(sums[part[1]] - sums[part[0]]), reverse=True)
    given = history.at(float(time_s[parts[0][0]]))
    for each, (least, _) in bounds.items():
        if each not in given:
            raise refused(each, absent(each))
        if given[each] < 0.0 or (least and not given[each]):
            raise refused(each, f"must be positive, got {given[each]:g}")
    chosen, left_s = [], LONGEST_FLIGHT_S
    for part in (each for each in parts if history.at(float(time_s[each[0]])) == given):
        first, end = _richest(time_s, sums, part, left_s)
        duration_s = float(time_s[end - 1] - time_s[first])
        if duration_s >= SHORTEST_PART_S:
            chosen.append((first, end))
            left_s -= duration_s
    return given, sorted(chosen)


def thinned(time_s: Samples, part: Part) -> NDArray[np.int64]:
    """Rows of a part at about ten a second or fewer, as vehicles log them by default."""
    first, end = part
    if np.median(np.diff(time_s[first:end])) >= _ALREADY_THIN * _INTERVAL_S:
        return np.arange(first, end)
    tenths = np.floor((time_s[first:end] - time_s[first]) / _INTERVAL_S + 0.5)
    return first + np.flatnonzero(np.diff(tenths, prepend=-1.0) > 0.0)
