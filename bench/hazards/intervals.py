"""Stretches of time."""

from collections.abc import Iterable, Sequence

Span = tuple[float, float]


def merged(spans: Iterable[Span]) -> list[Span]:
    """The same time, each moment once, in order."""
    whole: list[Span] = []
    for begin_s, end_s in sorted(spans):
        if whole and begin_s <= whole[-1][1]:
            whole[-1] = (whole[-1][0], max(whole[-1][1], end_s))
        else:
            whole.append((begin_s, end_s))
    return whole


def overlap(one: Span, other: Span) -> float:
    """How long both last together, s."""
    return max(min(one[1], other[1]) - max(one[0], other[0]), 0.0)


def longest(spans: Sequence[Span], within: Sequence[Span]) -> float:
    """The longest stretch that one of `spans` spends without a break inside `within`, whose parts follow each other."""
    whole = merged(within)
    return max((overlap(one, other) for one in spans for other in whole), default=0.0)


def total(spans: Sequence[Span], within: Sequence[Span]) -> float:
    """How long `spans` and `within` last together, s."""
    return sum(overlap(one, other) for one in merged(spans) for other in merged(within))


def covers(spans: Sequence[Span], stretch: Span) -> bool:
    """Whether one of `spans` lasts through all of `stretch`."""
    return any(one[0] <= stretch[0] and one[1] >= stretch[1] for one in merged(spans))
