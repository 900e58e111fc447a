"""The overlay of flights of any campaigns: told apart by more than colour, and held against the first."""

import itertools

import numpy as np

from app.figures.base import card_of
from app.figures.comparison import ComparedCurve, ComparisonData, ComparisonFigure, pen
from app.figures.data import NO_CURVE, Curve
from app.figures.theme import PALETTES
from tests.figures.builders import SET_POINT, TIME_S, climb, layout, trace, traces


def compared(*curves: Curve | None, first: str = "flight 0") -> ComparisonData:
    return ComparisonData(
        output_title="Altitude",
        output_unit="m",
        error_unit="m",
        set_point=SET_POINT,
        flights=tuple(
            ComparedCurve(
                index=index,
                trial_id=10 + index,
                label="ABCDE"[index],
                name=f"flight {index}" if index else first,
                curve=curve or NO_CURVE,
                error=0.1,
            )
            for index, curve in enumerate(curves)
        ),
    )


def test_twenty_flights_are_told_apart_by_colour_and_dash_together() -> None:
    for palette in PALETTES.values():
        pens = [(pen(palette, index)["color"], pen(palette, index)["dash"]) for index in range(20)]
        assert len(set(pens)) == 20
        assert all(one[0] != other[0] and one[1] != other[1] for one, other in itertools.pairwise(pens)), (
            "neighbours differ in both"
        )


def test_below_each_flight_stands_against_the_first_as_far_as_both_were_recorded() -> None:
    short = Curve(TIME_S[:1001], climb(0.5).values[:1001])
    card = card_of(ComparisonFigure(compared(climb(0.2), climb(0.3), short)))
    assert card.state == "ready", card.reason
    for trial, overshoot_m in ((11, 0.1), (12, 0.3)):
        drawn = trace(card, "difference", trial=trial)
        x = np.array(drawn["x"])
        np.testing.assert_allclose(drawn["y"], overshoot_m * np.exp(-((x - 2.0) ** 2)), atol=2e-4)
        assert drawn["line"] == trace(card, "flight", trial=trial)["line"]
    assert max(trace(card, "difference", trial=12)["x"]) == 10.0
    assert not [one for one in traces(card) if one["meta"] == {"role": "difference", "trial": 10}]
    assert layout(card)["yaxis2"]["title"]["text"] == "Difference from A (m)"
    assert card.table is not None
    assert [column.name for column in card.table.columns] == [
        "time_s", "set_point", "a", "b", "c", "b_less_a", "c_less_a"
    ]  # fmt: skip


def test_a_wild_flight_is_marked_and_does_not_flatten_the_others() -> None:
    card = card_of(ComparisonFigure(compared(climb(0.2), climb(0.3), climb(0.25), climb(40.0))))
    assert layout(card)["yaxis"]["range"][1] < 5.0
    assert trace(card, "off scale", trial=13)["text"] == ["D ↑ 43.0\u00a0m"]
    assert "1 off scale" in card.summary


def test_what_a_campaign_is_called_is_drawn_as_it_is_written() -> None:
    card = card_of(ComparisonFigure(compared(climb(0.2), climb(0.3), first="%{x} <b>& co</b>")))
    drawn = trace(card, "flight", trial=10)
    assert drawn["name"] == "A · %&#123;x} &lt;b&gt;&amp; co&lt;/b&gt;"
    assert drawn["hovertemplate"].startswith(f"<b>{drawn['name']}</b><br>%{{x:.2f}} s")
    assert "A, %{x} <b>& co</b>, error" in card.summary
    assert card.table is not None
    assert card.table.columns[2].title == "A · %{x} <b>& co</b>"


def test_without_any_record_it_says_so() -> None:
    card = card_of(ComparisonFigure(compared(None, None)))
    assert (card.state, card.reason) == ("waiting", "None of these flights has a record.")
    alone = card_of(ComparisonFigure(compared(None, climb(0.2))))
    assert [one["meta"]["role"] for one in traces(alone)] == ["set point", "flight"]
