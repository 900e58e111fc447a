"""Panels one above the other: every line drawn where it belongs, told apart, and in the table."""

import pytest

from app.figures.base import card_of
from app.figures.panels import Line, Panel, PanelsFigure, Plot
from app.figures.theme import ThemeName


def plot(*panels: Panel) -> Plot:
    return Plot(title="Two runs", summary="They differ.", x_title="Time (s)", panels=panels, x_range=(0.0, 2.0))


MODEL = Line(name="Model", style="model", x=(0.0, 1.0, 2.0), y=(0.0, 2.0, 4.0))
FLIGHTS = Line(name="Flights", style="run 1", x=(1.0,), y=(2.5,), marks=True, note="the first one")
UPPER = Panel(y_title="Altitude (m)", lines=(MODEL, FLIGHTS), y_range=(0.0, 5.0))
LOWER = Panel(y_title="Thrust", lines=(MODEL,), digits=1)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_line_is_drawn_in_its_panel_and_named_once(theme: ThemeName) -> None:
    card = card_of(PanelsFigure(plot(UPPER, LOWER), theme_name=theme))
    assert (card.state, card.title, card.summary) == ("ready", "Two runs", "They differ.")
    assert card.figure is not None
    traces = card.figure["data"]
    assert isinstance(traces, list)
    assert [(trace["meta"]["line"], trace["meta"]["panel"], trace["showlegend"]) for trace in traces] == [
        ("Model", 1, True),
        ("Flights", 1, True),
        ("Model", 2, False),
    ]
    assert [trace["mode"] for trace in traces] == ["lines", "markers", "lines"]
    assert [trace["yaxis"] for trace in traces] == ["y", "y", "y2"]
    assert (traces[0]["x"], traces[0]["y"]) == ([0.0, 1.0, 2.0], [0.0, 2.0, 4.0])
    assert "the first one" in traces[1]["hovertemplate"]


def test_panels_share_their_abscissa_and_do_not_overlap() -> None:
    card = card_of(PanelsFigure(plot(UPPER, LOWER)))
    assert card.figure is not None
    layout = card.figure["layout"]
    assert isinstance(layout, dict)
    assert layout["xaxis2"]["matches"] == "x"
    assert layout["xaxis"]["range"] == [0.0, 2.0]
    assert layout["yaxis"]["range"] == [0.0, 5.0]
    assert layout["yaxis"]["domain"][0] > layout["yaxis2"]["domain"][1]
    assert layout["xaxis2"]["title"]["text"] == "Time (s)"


def test_the_table_has_a_column_for_each_line_and_no_value_that_was_not_there() -> None:
    table = card_of(PanelsFigure(plot(UPPER, LOWER))).table
    assert table is not None
    assert [column.title for column in table.columns] == [
        "Time (s)",
        "Altitude (m): Model",
        "Altitude (m): Flights",
        "Thrust: Model",
    ]
    assert table.rows == ((0.0, 0.0, None, 0.0), (1.0, 2.0, 2.5, 2.0), (2.0, 4.0, None, 4.0))


def test_a_long_line_is_tabled_at_even_steps() -> None:
    long = Line(name="Long", style="after", x=tuple(map(float, range(500))), y=tuple(map(float, range(500))))
    whole = Plot(title="Long", summary="", x_title="x", panels=(Panel(y_title="y", lines=(long,)),))
    table = card_of(PanelsFigure(whole)).table
    assert table is not None
    assert len(table.rows) == 33
    assert table.rows[0] == (0.0, 0.0)
    assert table.rows[-1] == (499.0, 499.0)


def test_nothing_to_draw_is_said() -> None:
    card = card_of(PanelsFigure(plot(Panel(y_title="y", lines=()))))
    assert (card.state, card.reason) == ("waiting", "Nothing to draw.")
