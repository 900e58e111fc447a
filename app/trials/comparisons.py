"""Comparison of a flight's gains with the best before it and with the first, given the scatter of repeated flights."""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Final, Literal

from app.core.definition import Flight
from app.core.experiments.base import Scatter
from app.core.policy import Gains
from app.core.statistics import Group, PooledScatter, compare, groups_of, pool_scatter
from app.db.models import TrialRow
from app.trials.schemas import TrialComparison

CONFIDENCE: Final = 0.9


class ReferenceFlights:
    """The valid flights that a campaign's trials are compared with, indexed for constant or logarithmic lookup.

    `valid` are the flights in their order, `prior` is the experiment's scatter.
    """

    def __init__(self, valid: Sequence[Flight], prior: Scatter) -> None:
        groups = groups_of(valid)
        scored = [(flight.error, flight.number) for flight in valid if flight.error is not None]
        self._numbers = [number for _, number in scored]
        self._best_so_far = list(accumulate(scored, min))
        self._by_number: Mapping[int, Group] = {number: group for group in groups for number in group.numbers}
        self._by_gains: Mapping[object, Group] = {_key(group.gains): group for group in groups}
        self.scatter: Final[PooledScatter | None] = pool_scatter(groups, prior) if groups else None

    def best_before(self, number: int) -> tuple[float, int] | None:
        """Error and number of the best flight before the given one."""
        before = bisect_left(self._numbers, number)
        return self._best_so_far[before - 1] if before else None

    def first_before(self, number: int) -> int | None:
        """Number of the first flight, if it is before the given one."""
        return self._numbers[0] if self._numbers and self._numbers[0] < number else None

    def group_of(self, number: int) -> Group | None:
        """All flights with the gains of the given flight."""
        return self._by_number.get(number)

    def group_with(self, gains: Gains) -> Group | None:
        """All flights of the given gains."""
        return self._by_gains.get(_key(gains))


def comparisons(row: TrialRow, field: ReferenceFlights) -> list[TrialComparison]:
    """Comparisons with the best flight before this one, then with the first; flights of the same gains are left out.

    Each side counts with all flights of its gains.
    """
    own = field.group_of(row.number)
    if own is None or field.scatter is None:
        return []
    found = []
    for against, number in _others(row, field):
        other = field.group_of(number)
        if other is None or other.gains == own.gains:
            continue
        said = compare(own, other, field.scatter, CONFIDENCE, foresee=False)
        found.append(
            TrialComparison(
                against=against,
                trial_number=number,
                verdict=said.verdict,
                confidence=said.confidence,
                difference=said.difference,
                standard_error=said.standard_error,
            )
        )
    return found


def _others(row: TrialRow, field: ReferenceFlights) -> Iterator[tuple[Literal["best before", "first"], int]]:
    best, first = field.best_before(row.number), field.first_before(row.number)
    if best is None or first is None:
        return
    yield "best before", best[1]
    if first != best[1]:
        yield "first", first


def _key(gains: Gains) -> object:
    return tuple(sorted(gains.items()))
