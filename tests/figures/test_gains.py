from dataclasses import replace

import pytest

from app.figures.gains import GainsFigure, padded
from tests.figures.builders import GAINS, flight, history, layout, proposal, trace


def test_every_gain_has_its_own_panel_with_the_values_flown() -> None:
    card = GainsFigure(history(flight(1, 0.3), flight(2, 0.2))).compute()
    assert trace(card, "flown", gain="kp")["y"] == [281, 282]
    assert trace(card, "flown", gain="ki")["y"] == [10, 20]
    domains = [layout(card)[axis]["domain"] for axis in ("yaxis", "yaxis2", "yaxis3")]
    assert domains[0][0] > domains[1][1] > domains[1][0] > domains[2][1]


def test_every_panel_says_above_it_what_its_gain_is() -> None:
    named = layout(GainsFigure(history(flight(1, 0.3))).compute())["annotations"]
    assert [one["text"].split(" ")[0] for one in named] == ["<b>kp</b>", "<b>ki</b>", "<b>kd</b>"]
    assert all(gain.title in one["text"] and gain.unit in one["text"] for gain, one in zip(GAINS, named, strict=True))
    assert named[0]["y"] > named[1]["y"] > named[2]["y"]


def test_titles_that_do_not_fit_on_a_phone_show_under_the_pointer() -> None:
    long = tuple(replace(gain, name=f"PSC_{gain.name}", title=f"{gain.title} of the climb rate loop") for gain in GAINS)
    flown = replace(history(flight(1, 0.3)), gains=long)
    flown = replace(
        flown, flights=tuple(replace(one, gains={gain.name: 1.0 for gain in long}) for one in flown.flights)
    )
    named = layout(GainsFigure(flown).compute())["annotations"]
    assert [one["text"] for one in named] == [
        "<b>PSC_kp</b> (counts)",
        "<b>PSC_ki</b> (counts)",
        "<b>PSC_kd</b> (counts)",
    ]
    assert [one["hovertext"] for one in named] == [gain.title for gain in long]


def test_the_proposed_gains_are_open_diamonds_at_the_next_flight() -> None:
    card = GainsFigure(history(flight(1, 0.3), proposal=proposal(2))).compute()
    drawn = trace(card, "next", gain="ki")
    assert (drawn["x"], drawn["y"], drawn["marker"]["symbol"]) == ([2], [200], "diamond-open")


def test_a_change_of_one_count_does_not_fill_the_panel() -> None:
    low, high = padded(283, 284, GAINS[0])
    assert high - low == pytest.approx(0.5 * 400 * 1.3)


def test_the_panel_does_not_reach_below_a_bound() -> None:
    low, _ = padded(0, 13, GAINS[1])
    assert low == pytest.approx(-0.05 * 53.65)


def test_the_table_ends_with_the_proposed_row() -> None:
    card = GainsFigure(history(flight(1, 0.3), proposal=proposal(2))).compute()
    assert card.table is not None
    assert card.table.rows == (("1", 281, 10, 80), ("proposed", 500, 200, 90))


def test_without_flights_and_proposal_the_card_says_so() -> None:
    assert GainsFigure(history()).not_ready() is not None
