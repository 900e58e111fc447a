from dataclasses import replace

import pytest

from app.core.definition import Interval
from app.figures.data import Noise, Range, Repeats
from app.figures.error_history import ErrorsFigure
from tests.figures.builders import flight, history, layout, proposal, trace, traces

TABLE_1 = [
    flight(1, 0.3267, predicted_error=0.33),
    flight(2, 0.1873, predicted_error=0.2),
    flight(3, 0.1788),
    flight(4, 0.1467),
    flight(5, 0.1515),
]


def test_without_a_scored_flight_the_card_says_when_it_will_be_filled() -> None:
    assert ErrorsFigure(history()).not_ready() == "The error of each flight appears here after the first valid flight."
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
    assert set(drawn["marker"]["symbol"]) == {"diamond-open"}


def test_a_prediction_far_above_all_flights_is_drawn_at_the_edge_with_its_value() -> None:
    card = ErrorsFigure(history(flight(1, 0.3, predicted_error=2.0), flight(2, 0.2))).compute()
    drawn = trace(card, "predicted")
    assert drawn["y"] == pytest.approx([layout(card)["yaxis"]["range"][1]], abs=1e-6)
    assert drawn["text"] == ["2.0000"]
    assert drawn["marker"]["symbol"] == ["triangle-up-open"]


def test_the_axis_covers_what_was_predicted_of_a_single_flight_that_was_better() -> None:
    """Observed defect: the diamond of 0.1135 m stood at 0.107 m, the end of the axis."""
    card = ErrorsFigure(history(flight(1, 0.1, predicted_error=0.115))).compute()
    drawn = trace(card, "predicted")
    assert drawn["y"] == [0.115]
    assert layout(card)["yaxis"]["range"][1] > 0.115
    assert "%{text} m<" in drawn["hovertemplate"]


@pytest.mark.parametrize(("flights", "step"), [(1, 1), (12, 1), (13, 2), (60, 5), (119, 10), (500, 50), (1000, 100)])
def test_flight_numbers_on_an_axis_are_round_and_a_dozen_at_most(flights: int, step: int) -> None:
    axis = layout(ErrorsFigure(history(flight(1, 0.3), flight(flights, 0.2))).compute())["xaxis"]
    assert (axis["tick0"], axis["dtick"]) == (0, step)
    assert flights // step <= 12


def test_an_invalid_flight_is_a_cross_and_never_the_best() -> None:
    card = ErrorsFigure(history(flight(1, 0.3), flight(2, None, outcome="invalid"), flight(3, 0.2))).compute()
    assert trace(card, "measured")["x"] == [1, 3]
    assert trace(card, "not counted")["x"] == [2]
    assert trace(card, "best so far")["y"] == [0.3, 0.2]
    assert card.summary == "Best error 0.200 m in flight 3, 33 % below flight 1."


def test_a_flight_without_an_error_stands_in_a_strip_below_the_axis_of_errors() -> None:
    """Seen: an aborted flight looked like one with an error of 0.015 m, the best of all."""
    flights = (flight(1, 0.3), flight(2, None, outcome="aborted"), flight(3, None, outcome="not yet reviewed"))
    card = ErrorsFigure(history(*flights)).compute()
    errors, strip = layout(card)["yaxis"], layout(card)["yaxis2"]
    assert strip["domain"][1] < errors["domain"][0]
    assert (strip["tickvals"], strip["ticktext"], strip["range"]) == ([0], ["no error"], [-1, 1])
    assert layout(card)["xaxis"]["anchor"] == "y2"
    for role, number in (("not counted", 2), ("not yet reviewed", 3)):
        drawn = trace(card, role)
        assert (drawn["x"], drawn["y"], drawn["yaxis"]) == ([number], [0], "y2")
        assert "no error" in drawn["hovertemplate"]
    assert trace(card, "not yet reviewed")["name"] == "Not yet reviewed"


def test_an_unreviewed_flight_with_an_error_stands_at_it_and_needs_no_strip() -> None:
    card = ErrorsFigure(history(flight(1, 0.3), flight(2, 0.2, outcome="not yet reviewed"))).compute()
    drawn = trace(card, "not yet reviewed")
    assert (drawn["x"], drawn["y"], drawn["yaxis"], drawn["showlegend"]) == ([2], [0.2], "y", True)
    assert "yaxis2" not in layout(card)
    assert layout(card)["yaxis"]["domain"] == [0.0, 1.0]


def test_a_flight_with_a_huge_error_is_marked_at_the_edge_with_its_value() -> None:
    card = ErrorsFigure(history(*TABLE_1, flight(6, 4.2))).compute()
    assert layout(card)["yaxis"]["range"][1] < 1.0
    assert trace(card, "off scale", trial=6)["text"] == ["↑ 4.20"]


def test_of_huge_errors_side_by_side_only_those_with_room_for_their_value_have_it_in_print() -> None:
    wild = [flight(number, 4.0 + number / 100) for number in (16, 17, 20)]
    card = ErrorsFigure(
        history(*TABLE_1, *(flight(number, 0.2) for number in (*range(6, 16), 18, 19)), *wild)
    ).compute()
    assert trace(card, "off scale", trial=16)["text"] == ["↑ 4.16"]
    assert (trace(card, "off scale", trial=17)["text"], trace(card, "off scale", trial=17)["mode"]) == ([""], "markers")
    assert trace(card, "off scale", trial=17)["hovertemplate"] == "Flight 17: 4.17 m<extra></extra>"
    assert trace(card, "off scale", trial=20)["text"] == ["↑ 4.20"]


def test_each_flight_stands_over_the_interval_it_was_expected_in() -> None:
    flights = (flight(1, 0.3), flight(2, 0.19, predicted_error=0.2, interval=Interval(lower=0.18, upper=0.22)))
    card = ErrorsFigure(history(*flights, proposal=proposal(3, interval=Interval(lower=-0.01, upper=0.15)))).compute()
    drawn = trace(card, "interval")
    assert drawn["x"] == [2, 2, None, 3, 3, None]
    assert drawn["y"] == [0.18, 0.22, None, 0.0, 0.15, None]


def test_the_next_flight_is_the_last_of_the_predictions_and_named_for_the_page_that_moves_it() -> None:
    flights = (flight(1, 0.3), flight(2, 0.19, predicted_error=0.2, interval=Interval(lower=0.18, upper=0.22)))
    card = ErrorsFigure(history(*flights, proposal=proposal(3, interval=Interval(lower=0.1, upper=0.15)))).compute()
    for role in ("predicted", "interval"):
        drawn = trace(card, role)
        assert (drawn["meta"]["next"], drawn["visible"]) == (3, True)
        assert [number for number in drawn["x"] if number is not None][-1] == 3
    unpredicted = replace(proposal(2), predicted_error=None)
    card = ErrorsFigure(history(flight(1, 0.3), proposal=unpredicted)).compute()
    for role in ("predicted", "interval"):
        assert (trace(card, role)["x"], trace(card, role)["visible"]) == ([], False)
    without_proposal = ErrorsFigure(history(*TABLE_1[2:])).compute()
    assert not {"predicted", "interval"} & {one["meta"]["role"] for one in traces(without_proposal)}


def test_an_interval_far_above_all_errors_is_cut_at_the_edge_and_does_not_stretch_the_axis() -> None:
    card = ErrorsFigure(
        history(flight(1, 0.3), proposal=proposal(2, interval=Interval(lower=0.1, upper=7.0)))
    ).compute()
    top = layout(card)["yaxis"]["range"][1]
    assert top < 0.4
    assert trace(card, "interval")["y"] == [0.1, pytest.approx(top), None]


def test_the_noise_is_drawn_as_error_bars_as_means_of_repeats_and_as_a_band_around_the_best() -> None:
    noise = Noise(0.0141, (Repeats((4, 5), 0.1491, 0.01),), Range(0.12, 0.178))
    card = ErrorsFigure(history(*TABLE_1, noise=noise)).compute()
    assert trace(card, "measured")["error_y"]["value"] == 0.0141
    repeats = trace(card, "repeats")
    assert (repeats["y"], repeats["error_y"]["array"]) == ([0.1491], [0.01])
    assert "Flights 4, 5" in repeats["text"][0]
    assert set(trace(card, "noise")["y"]) == {0.12, 0.178}
    quiet = {one["meta"]["role"] for one in traces(ErrorsFigure(history(*TABLE_1)).compute())}
    assert not quiet & {"noise", "repeats", "interval"}


def test_the_table_lists_every_flight_with_its_running_best_and_the_next_one_last() -> None:
    card = ErrorsFigure(
        history(
            flight(1, 0.3),
            flight(2, None, outcome="invalid"),
            flight(3, 0.2, predicted_error=0.21, interval=Interval(lower=0.19, upper=0.23)),
            proposal=proposal(4, interval=Interval(lower=0.1, upper=0.14)),
            noise=Noise(0.01),
        )
    ).compute()
    assert card.table is not None
    assert card.table.rows == (
        (1, "valid", 0.3, 0.01, None, None, None, 0.3),
        (2, "invalid", None, None, None, None, None, None),
        (3, "valid", 0.2, 0.01, 0.21, 0.19, 0.23, 0.2),
        (4, "proposed", None, None, 0.12, 0.1, 0.14, None),
    )
    assert {len(row) for row in card.table.rows} == {len(card.table.columns)}
