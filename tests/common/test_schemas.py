"""Views: parts of the API with the fields of what they show."""

from dataclasses import dataclass

import pytest

from app.common.schemas import Trouble


@dataclass(frozen=True)
class Happening:
    title: str
    detail: str
    place: str


def test_a_view_takes_the_fields_of_its_source_and_those_given() -> None:
    view = Trouble.view_of(Happening("Busy.", "It flies.", "here"), detail="It lands.", hint="Wait.")
    assert view == Trouble(title="Busy.", detail="It lands.", hint="Wait.")


def test_a_view_needs_every_field() -> None:
    with pytest.raises(AttributeError, match="no attribute"):
        Trouble.view_of(Happening("Busy.", "It flies.", "here"))
