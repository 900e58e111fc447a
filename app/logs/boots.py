"""One clock for a log of several boots, of which each begins anew: rings put in order, damaged times left out."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.records.trajectory import Samples
from app.logs.base import Table, numbers

CLOCK: Final = "TimeUS"
"""The column of the one clock, µs, in every table."""
_JUMP_US: Final = 1e6
"""If the clock goes back by more than this, the vehicle restarted."""
_BETWEEN_BOOTS_US: Final = 20e6
_DAMAGED_ROWS: Final = 10
"""So many rows or fewer whose clock is far from those before and after them have a damaged one."""


Places = NDArray[np.uint32]
Placed = tuple[Places, Table]
"""The places of a table's rows in the file, increasing, and its columns; shape (n,) each."""


def on_one_clock(rows: Mapping[str, Placed], begins: Sequence[int]) -> tuple[dict[str, Table], list[float], int]:
    """The tables by one clock for all boots, which goes on some time after the one before; when the vehicle started
    anew, s, and how many rows had a damaged time and were left out. No table has a clock if none had one before.

    `begins` are the places at which the logging began anew. A row without a clock has that of the row before it in the
    file, or of the one after it if the logging began anew between.
    """
    counts = [len(places) for places, _ in rows.values()]
    places = np.concatenate([np.empty(0, np.uint32), *(each for each, _ in rows.values())])
    order = np.argsort(places, kind="stable")
    clocks = (numbers(table[CLOCK]) if CLOCK in table else np.full(len(each), np.nan) for each, table in rows.values())
    time_us = np.concatenate([np.empty(0), *clocks])[order]
    has_clock = np.isfinite(time_us)
    if not has_clock.any():
        return {name: table for name, (_, table) in rows.items()}, [], 0
    is_odd = np.zeros(len(order), np.bool_)
    is_odd[has_clock] = _is_odd(time_us[has_clock])
    sound, bare = np.flatnonzero(has_clock & ~is_odd), np.flatnonzero(~has_clock)
    starts = np.searchsorted(places[order], begins)
    before = np.searchsorted(sound, bare) - 1
    begun, begun_before = (np.searchsorted(starts, each, side="right") for each in (bare, sound[before]))
    time_us[bare] = time_us[sound[np.minimum(before + ((before < 0) | (begun > begun_before)), len(sound) - 1)]]
    kept, boots = _boots(time_us, starts, np.flatnonzero(~is_odd))
    time_us, source = np.concatenate(boots), order[kept]
    tables: dict[str, Table] = {}
    for (name, (_, table)), count, end in zip(rows.items(), counts, np.cumsum(counts), strict=True):
        mine = (source >= end - count) & (source < end)
        row = source[mine] - (end - count)
        tables[name] = {column: values[row] for column, values in table.items()} | {CLOCK: time_us[mine]}
    return tables, [float(boot[0]) / 1e6 for boot in boots[1:]], int(is_odd.sum())


def _boots(
    time_us: Samples, starts: NDArray[np.int64], kept: NDArray[np.int64]
) -> tuple[NDArray[np.int64], list[Samples]]:
    """The rows in order, and the clock of each boot, shifted to after the one before. If the file begins within a log
    whose clock goes on from the end of the file, it is a ring, and begins with the boot after. `starts` are the rows
    before which the logging began."""
    steps, begun = np.diff(time_us[kept]), np.searchsorted(kept, starts)
    begun = begun[(begun > 0) & (begun < len(kept))]
    first = np.union1d(np.flatnonzero(steps < -_JUMP_US) + 1, begun[steps[begun - 1] > _JUMP_US])
    on_us = time_us[kept[0]] - time_us[kept[-1]]
    if len(first) and 0 not in starts and 0.0 <= on_us <= _JUMP_US:
        kept, first = np.roll(kept, -first[0]), first[1:] - first[0]
    boots = np.split(time_us[kept], first)
    for earlier, later in pairwise(boots):
        end_us = np.max(earlier)
        if later[0] <= end_us + _JUMP_US:
            np.add(later, end_us + _BETWEEN_BOOTS_US - later[0], out=later)
    return kept, boots


def _is_odd(time_us: Samples) -> NDArray[np.bool_]:
    """Rows, shape (n,), of a few whose time is far from that of the rows around them, which go on without them."""
    first = np.append(0, np.flatnonzero(np.abs(np.diff(time_us)) > _JUMP_US) + 1)
    counts = np.diff(first, append=len(time_us))
    before, after = np.append(-np.inf, time_us[first[1:] - 1]), np.append(time_us[first[1:]], np.inf)
    is_apart = (time_us[first + counts - 1] > after + _JUMP_US) | (time_us[first] < before - _JUMP_US)
    is_odd = (counts <= _DAMAGED_ROWS) & (after >= before - _JUMP_US) & is_apart
    return np.repeat(is_odd & ~is_odd.all(), counts)
