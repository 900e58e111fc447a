"""Views: parts of the API with the fields of what they show."""

from dataclasses import dataclass

import pytest

from app.common.schemas import Interval, Trouble


@dataclass(frozen=True)
class Range:
    lower: float
    upper: float
    unit: str


def test_a_view_takes_the_fields_of_its_source_and_those_given() -> None:
    view = Interval.view_of(Range(0.1, 0.3, "m"), upper=0.4, confidence=0.9)
    assert view == Interval(lower=0.1, upper=0.4, confidence=0.9)


def test_a_view_needs_every_field() -> None:
    with pytest.raises(AttributeError, match="no attribute"):
        Trouble.view_of(Range(0.1, 0.3, "m"))
