"""A flight's gains against the best before it and against the first ones, with the scatter of repeats allowed for."""

from collections.abc import Iterator, Sequence
from typing import Final, Literal

from app.core.confirming import Standing
from app.core.statistics import Group, compare
from app.db.models import TrialRow
from app.trials.schemas import TrialComparison

CONFIDENCE: Final = 0.9


def comparisons(row: TrialRow, scored: Sequence[tuple[int, float]], now: Standing | None) -> list[TrialComparison]:
    """Against the best flight before it, then against the first; without those of the same gains. Each side counts with
    all its flights. `scored` holds number and error of every valid trial."""
    own = None if now is None else _group_of(now, row.number)
    if now is None or own is None:
        return []
    found = []
    for against, number in _others(row, scored):
        other = _group_of(now, number)
        if other is None or other.gains == own.gains:
            continue
        said = compare(own, other, now.scatter, CONFIDENCE)
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


def _others(
    row: TrialRow, scored: Sequence[tuple[int, float]]
) -> Iterator[tuple[Literal["best before", "first"], int]]:
    before = [(error, number) for number, error in scored if number < row.number]
    if not before:
        return
    best, first = min(before)[1], min(number for _, number in before)
    yield "best before", best
    if first != best:
        yield "first", first


def _group_of(now: Standing, number: int) -> Group | None:
    return next((group for group in now.groups if number in group.numbers), None)
