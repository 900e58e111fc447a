import pytest

from app.figures.errors import ErrorsFigure
from tests.figures.builders import flight, history, layout, proposal, trace, traces

TABLE_1 = [
    flight(1, 0.3267, predicted_error=0.33),
    flight(2, 0.1873, predicted_error=0.2),
    flight(3, 0.1788),
    flight(4, 0.1467),
    flight(5, 0.1515),
]


def test_without_a_scored_flight_the_card_says_when_it_will_be_filled() -> None:
    assert ErrorsFigure(history()).not_ready() == "The error of each flight appears here after the first landing."
    assert ErrorsFigure(history(flight(1, None, outcome="aborted"))).not_ready() is not None


def test_measured_errors_and_the_best_so_far_are_drawn_as_flown() -> None:
    card = ErrorsFigure(history(*TABLE_1)).compute()
    assert trace(card, "measured")["y"] == [0.3267, 0.1873, 0.1788, 0.1467, 0.1515]
    assert trace(card, "best so far")["y"] == [0.3267, 0.1873, 0.1788, 0.1467, 0.1467]
    assert [label["text"] for label in layout(card)["annotations"]] == ["0.327", "0.187", "0.179", "0.147", "0.151"]
    assert trace(card, "measured")["marker"]["symbol"] == ["circle", "circle", "circle", "star", "circle"]


def test_the_threshold_is_what_the_stop_rule_asks_of_the_next_flight() -> None:
    card = ErrorsFigure(history(*TABLE_1)).compute()
    assert trace(card, "threshold")["y"] == pytest.approx([0.95 * 0.1467] * 2, abs=1e-6)
    budget_only = ErrorsFigure(history(*TABLE_1, improvement=None)).compute()
    assert "threshold" not in {one["meta"]["role"] for one in traces(budget_only)}


def test_predictions_of_flown_and_of_the_next_flight_are_open_diamonds() -> None:
    drawn = trace(ErrorsFigure(history(*TABLE_1, proposal=proposal(6))).compute(), "predicted")
    assert (drawn["x"], drawn["y"]) == ([1, 2, 6], [0.33, 0.2, 0.12])
    assert drawn["marker"]["symbol"] == "diamond-open"


def test_an_invalid_flight_is_a_cross_and_never_the_best() -> None:
    card = ErrorsFigure(history(flight(1, 0.3), flight(2, None, outcome="invalid"), flight(3, 0.2))).compute()
    assert trace(card, "measured")["x"] == [1, 3]
    assert (trace(card, "not counted")["x"], trace(card, "not counted")["y"]) == (
        [2],
        pytest.approx([0.05 * 0.3], rel=0.2),
    )
    assert trace(card, "best so far")["y"] == [0.3, 0.2]
    assert card.summary == "Best error 0.200 m in flight 3, 33 % below flight 1."


def test_a_flight_with_a_huge_error_is_marked_at_the_edge_with_its_value() -> None:
    card = ErrorsFigure(history(*TABLE_1, flight(6, 4.2))).compute()
    assert layout(card)["yaxis"]["range"][1] < 1.0
    assert trace(card, "off scale", trial=6)["text"] == ["↑ 4.20"]


def test_the_table_lists_every_flight_with_its_running_best() -> None:
    card = ErrorsFigure(history(flight(1, 0.3), flight(2, None, outcome="invalid"), flight(3, 0.2))).compute()
    assert card.table is not None
    assert card.table.rows == (
        (1, "valid", 0.3, None, 0.3),
        (2, "invalid", None, None, None),
        (3, "valid", 0.2, None, 0.2),
    )
