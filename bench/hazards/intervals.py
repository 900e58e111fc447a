"""Operations on intervals of time."""

from collections.abc import Iterable, Sequence

Span = tuple[float, float]


def merged(spans: Iterable[Span]) -> list[Span]:
    """Return the union of the spans as disjoint spans in order."""
    whole: list[Span] = []
    for begin_s, end_s in sorted(spans):
        if whole and begin_s <= whole[-1][1]:
            whole[-1] = (whole[-1][0], max(whole[-1][1], end_s))
        else:
            whole.append((begin_s, end_s))
    return whole


def overlap(one: Span, other: Span) -> float:
    """Return the duration of the intersection, s."""
    return max(min(one[1], other[1]) - max(one[0], other[0]), 0.0)


def longest(spans: Sequence[Span], within: Sequence[Span]) -> float:
    """Return the longest intersection of one of `spans` with the union of `within`, s."""
    whole = merged(within)
    return max((overlap(one, other) for one in spans for other in whole), default=0.0)


def total(spans: Sequence[Span], within: Sequence[Span]) -> float:
    """Return the duration of the intersection of both unions, s."""
    return sum(overlap(one, other) for one in merged(spans) for other in merged(within))


def covers(spans: Sequence[Span], span: Span) -> bool:
    """Whether the union of `spans` contains `span`."""
    return any(one[0] <= span[0] and one[1] >= span[1] for one in merged(spans))
