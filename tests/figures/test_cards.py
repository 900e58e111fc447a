import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import pytest

from app.core.definition import Interval
from app.figures import CAMPAIGN_FIGURES
from app.figures.base import Card, Figure, card_of
from app.figures.data import Noise, Range, Repeats
from app.figures.theme import PALETTES, Palette, ThemeName
from tests.figures.builders import flight, history, proposal


@dataclass(frozen=True)
class Broken(Figure):
    name = "broken"
    title = "Broken figure"

    def compute(self) -> Card:
        raise ZeroDivisionError("no flights to divide by")


def test_a_figure_that_breaks_becomes_an_error_card_and_a_logged_error(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR):
        card = card_of(Broken())
    assert (card.state, card.figure) == ("failed", None)
    assert "server's log" in card.reason
    assert "no flights to divide by" in caplog.text


@pytest.mark.parametrize("name", CAMPAIGN_FIGURES)
def test_every_registered_figure_gives_a_card_for_an_empty_and_for_a_flown_campaign(name: str) -> None:
    empty = card_of(CAMPAIGN_FIGURES[name](history(), theme_name="light"))
    flown = card_of(CAMPAIGN_FIGURES[name](history(flight(1, 0.3), flight(2, None, outcome="lost")), theme_name="dark"))
    assert empty.state in {"ready", "waiting"}
    assert (flown.name, flown.state) == (name, "ready")
    assert flown.table is not None
    assert all(len(row) == len(flown.table.columns) for row in flown.table.rows)


def luminance(colour: str) -> float:
    """WCAG 2.2 relative luminance of #rrggbb."""
    channels = [int(colour[start : start + 2], 16) / 255 for start in (1, 3, 5)]
    linear = [value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("palette", PALETTES.values(), ids=PALETTES)
def test_lines_keep_three_to_one_and_text_four_and_a_half_to_one_against_the_surface(palette: Palette) -> None:
    lines = (palette.best, palette.earlier, palette.prediction, palette.bad, *palette.gains)
    assert min(contrast(colour, palette.surface) for colour in lines) >= 3.0
    assert min(contrast(colour, palette.surface) for colour in (palette.ink, palette.dim)) >= 4.5


def drawn_colours(part: object, place: str = "") -> Iterator[tuple[str, str]]:
    """Where each opaque colour stands in a figure, and the colour; bands are see-through and lie under their edges."""
    if isinstance(part, Mapping):
        for name, value in part.items():
            yield from drawn_colours(value, f"{place}.{name}")
    elif isinstance(part, list | tuple):
        for value in part:
            yield from drawn_colours(value, place)
    elif isinstance(part, str) and part.startswith("#") and place.endswith(".color"):
        yield place, part


@pytest.mark.parametrize("theme", PALETTES)
@pytest.mark.parametrize("name", CAMPAIGN_FIGURES)
@pytest.mark.parametrize("flights", [5, 200])
def test_every_colour_that_a_figure_draws_with_can_be_seen_and_every_text_read(
    name: str, theme: ThemeName, flights: int
) -> None:
    noise = Noise(0.01, (Repeats((1, 2), 0.3, 0.01),), Range(0.2, 0.3))
    past = history(
        *(
            flight(number, 0.3 - 0.001 * number, predicted_error=0.2, interval=Interval(lower=0.1, upper=0.3))
            for number in range(1, flights)
        ),
        flight(flights, 9.0, overshoot_m=9.0),
        flight(flights + 1, None, outcome="aborted", glitches=(Range(2.0, 3.0),)),
        proposal=proposal(flights + 2, interval=Interval(lower=0.1, upper=0.2), band_m=0.1),
        noise=noise,
    )
    card = card_of(CAMPAIGN_FIGURES[name](past, theme_name=theme))
    surface = PALETTES[theme].surface
    found = list(drawn_colours(card.figure))
    assert found
    for place, colour in found:
        least = 4.5 if "font" in place else 3.0
        assert contrast(colour, surface) >= least, (place, colour)
