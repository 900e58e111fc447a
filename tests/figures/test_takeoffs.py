from dataclasses import replace

import numpy as np
import pytest

from app.figures.data import Curve, FlightData, NextFlight, Noise, Range, robust_top, thinned
from app.figures.takeoffs import TrajectoriesFigure
from tests.figures.builders import SET_POINT, TIME_S, climb, flight, history, layout, proposal, trace, traces


def test_before_the_first_flight_only_the_goal_and_the_prediction_are_drawn() -> None:
    card = TrajectoriesFigure(history(proposal=proposal(1))).compute()
    assert [one["meta"]["role"] for one in traces(card)] == [
        "target", "reference", "predicted deviation", "prediction", "live", "pointed", "live deviation"]  # fmt: skip
    assert set(trace(card, "target")["y"]) == {3.0}
    assert trace(card, "live")["x"] == []


def test_before_anything_is_predicted_the_panel_of_deviations_has_a_trace_by_which_it_is_placed() -> None:
    """Observed: without one the browser drew its axis at NaN."""
    card = TrajectoriesFigure(history()).compute()
    assert [len(one["x"]) for one in traces(card) if one.get("yaxis") == "y2"] == [1]
    assert layout(card)["xaxis"]["anchor"] == "y2"


def test_a_drawn_curve_follows_the_record_within_a_tenth_of_a_millimetre() -> None:
    card = TrajectoriesFigure(history(flight(1, 0.3))).compute()
    drawn = trace(card, "flight", trial=1)
    expected = np.interp(drawn["x"], TIME_S, climb(0.3).values)
    np.testing.assert_allclose(drawn["y"], expected, atol=1e-4)
    assert max(drawn["y"]) == pytest.approx(climb(0.3).values.max(), abs=1e-4)


def test_the_best_flight_is_emphasised_and_drawn_above_all_others() -> None:
    card = TrajectoriesFigure(
        history(flight(1, 0.3), flight(2, 0.1), flight(3, 0.2), flight(4, None, outcome="aborted"))
    )
    drawn = [one["meta"] for one in traces(card.compute()) if one["meta"]["role"] == "flight"]
    assert [(meta["trial"], meta["standing"]) for meta in drawn] == [
        (4, "invalid"),
        (1, "earlier"),
        (3, "earlier"),
        (2, "best"),
    ]
    widths = {one["meta"]["trial"]: one["line"]["width"] for one in traces(card.compute()) if "trial" in one["meta"]}
    assert widths[2] > max(widths[1], widths[3], widths[4])


@pytest.mark.parametrize("flights", [3, 40])
def test_every_trace_has_its_own_uid_and_keeps_it_in_the_figure_after_another_flight(flights: int) -> None:
    """A trace without one would get that of the trace at its place before: a flight's, which then points at it."""

    def uids(flown: int) -> dict[str, dict[str, object]]:
        own = [
            flight(number, 0.4 - 0.001 * number, glitches=(Range(5.0, 5.2),), overshoot_m=9.0 if number == 2 else 0.3)
            for number in range(1, flown + 1)
        ]
        aborted = flight(flown + 1, None, outcome="aborted")
        drawn = traces(TrajectoriesFigure(history(*own, aborted, proposal=proposal(flown + 2, band_m=0.2))).compute())
        found = {one["uid"]: one["meta"] for one in drawn}
        assert len(found) == len(drawn)
        return found

    before, after = uids(flights), uids(flights + 1)
    for uid in before.keys() & after.keys():
        assert before[uid]["role"] == after[uid]["role"]
    assert {"target", "reference", "prediction", "band-lower", "live", "flight-1", "deviation-1"} <= before.keys()


def test_flights_that_look_alike_share_an_entry_of_the_legend() -> None:
    card = TrajectoriesFigure(
        history(*(flight(number, 0.4 - 0.01 * number) for number in range(1, 6)), flight(6, None, outcome="aborted"))
    ).compute()
    entries = [one["name"] for one in traces(card) if one.get("showlegend", True)]
    assert entries == ["Set point", "Reference", "Flight 5 · best", "Earlier", "Not counted"]


def test_a_lucky_flight_of_other_gains_is_not_called_the_best() -> None:
    """The best gains are those with the best mean; the page says so beside the chart."""
    flights = (flight(1, 0.3), flight(2, 0.11), flight(3, 0.12), flight(4, 0.10))
    names = [
        [one["name"] for one in traces(TrajectoriesFigure(history(*flights, noise=noise)).compute())]
        for noise in (None, Noise(sd=0.01, best_numbers=(4,)), Noise(sd=0.01, best_numbers=(2, 3)))
    ]
    assert ["Flight 4 · best" in each for each in names] == [True, True, False]
    assert "Flight 4 · lowest error" in names[2]


def test_an_unreviewed_flight_is_not_drawn_like_an_excluded_one() -> None:
    card = TrajectoriesFigure(history(flight(1, 0.3), flight(2, 0.2, outcome="not yet reviewed"))).compute()
    drawn = trace(card, "flight", trial=2)
    assert (drawn["name"], drawn["meta"]["standing"], drawn["line"]["dash"]) == (
        "Flight 2 · not yet reviewed", "unjudged", "longdash")  # fmt: skip
    assert [one["name"] for one in traces(card) if one.get("showlegend", True)] == [
        "Set point", "Reference", "Flight 2 · not yet reviewed", "Flight 1 · best"]  # fmt: skip


def test_the_prediction_is_dashed_and_named_after_the_next_flight() -> None:
    drawn = trace(TrajectoriesFigure(history(flight(1, 0.3), proposal=proposal(2))).compute(), "prediction")
    assert drawn["line"]["dash"] == "dash"
    assert drawn["name"] == "Predicted"
    assert "Flight 2, predicted" in drawn["hovertemplate"]


def test_the_band_of_the_prediction_lies_below_every_curve() -> None:
    card = TrajectoriesFigure(history(flight(1, 0.3), proposal=proposal(2, band_m=0.2))).compute()
    assert [one["meta"].get("edge") for one in traces(card)][:2] == ["lower", "upper"]
    lower, upper = trace(card, "band", edge="lower"), trace(card, "band", edge="upper")
    assert upper["fill"] == "tonexty"
    np.testing.assert_allclose(lower["y"], np.interp(lower["x"], TIME_S, climb(0.1).values - 0.2), atol=1e-4)
    np.testing.assert_allclose(upper["y"], np.interp(upper["x"], TIME_S, climb(0.1).values + 0.2), atol=1e-4)
    assert card.table is not None
    assert [column.name for column in card.table.columns][-2:] == ["prediction_lower", "prediction_upper"]
    assert list(card.table.rows[-1][-2:]) == pytest.approx([2.8, 3.2], abs=1e-4)


def test_the_altitude_limit_is_there_for_the_page_that_observes_a_flight_and_hidden_on_others() -> None:
    limit = trace(TrajectoriesFigure(replace(history(), altitude_limit_m=4.5)).compute(), "limit")
    assert limit["y"] == [4.5, 4.5]
    assert limit["x"][1] == pytest.approx(32.6)
    assert limit["visible"] is False
    assert "limit" not in {one["meta"]["role"] for one in traces(TrajectoriesFigure(history()).compute())}


def test_a_glitch_is_marked_on_the_curve_where_it_happened() -> None:
    card = TrajectoriesFigure(history(flight(1, 0.3, glitches=(Range(5.0, 5.2), Range(9.0, 9.1))))).compute()
    marked = trace(card, "glitch", trial=1)
    seconds = [value for value in marked["x"] if value is not None]
    assert (min(seconds), max(seconds)) == (pytest.approx(4.99, abs=0.011), pytest.approx(9.1, abs=0.011))
    assert not [value for value in seconds if 5.25 < value < 8.95]
    assert None in marked["x"]


def test_an_error_around_zero_is_shown_on_both_sides() -> None:
    wave = Curve(TIME_S, 0.17 * np.sin(TIME_S))
    zero = Curve(TIME_S, np.zeros_like(TIME_S))
    first = replace(flight(1, 3.38), curve=wave)
    second = replace(flight(2, 0.2), curve=Curve(TIME_S, 0.01 * np.sin(TIME_S)))
    card = TrajectoriesFigure(replace(history(first, second), set_point=zero, reference=None)).compute()
    low, high = layout(card)["yaxis"]["range"]
    assert (low, high) == (pytest.approx(-0.19, abs=0.03), pytest.approx(0.19, abs=0.03))


def test_the_chart_opens_at_the_climb_with_the_deviation_below_and_knows_the_whole_flight() -> None:
    card = TrajectoriesFigure(history(flight(1, 0.3), flight(2, 0.2, overshoot_m=0.5), proposal=proposal(3))).compute()
    drawn = layout(card)
    assert drawn["xaxis"]["range"] == [-0.3, 8.0]
    assert drawn["meta"] == {"whole_s": [pytest.approx(-0.326), 32.6], "opening": "First 8 s"}
    assert drawn["yaxis2"]["range"] == [pytest.approx(-0.55, abs=1e-3), pytest.approx(0.55, abs=1e-3)]
    deviation = trace(card, "deviation", trial=2)
    assert (deviation["yaxis"], deviation.get("xaxis", "x"), deviation["showlegend"]) == ("y2", "x", False)
    expected = np.interp(deviation["x"], TIME_S, climb(0.5).values - 3.0)
    np.testing.assert_allclose(deviation["y"], expected, atol=1e-4)
    predicted = trace(card, "predicted deviation", trial=3)
    assert (predicted["line"], predicted["yaxis"]) == (trace(card, "prediction")["line"], "y2")
    expected = np.interp(predicted["x"], TIME_S, climb(0.1).values - 3.0)
    np.testing.assert_allclose(predicted["y"], expected, atol=1e-4)


def deviation_range(*flights: FlightData, following: NextFlight | None = None) -> list[float]:
    found: list[float] = layout(TrajectoriesFigure(history(*flights, proposal=following)).compute())["yaxis2"]["range"]
    return found


def test_the_deviations_of_best_and_latest_valid_flight_fit_their_panel_after_the_climb() -> None:
    """Seen: an overshoot of 0.81 m left a panel of ± 0.5 m."""
    best, latest = flight(2, 0.1, overshoot_m=0.02), flight(3, 0.3, overshoot_m=0.81)
    assert deviation_range(flight(1, 0.4), best, latest) == pytest.approx([-0.891, 0.891], abs=1e-3)
    aborted = flight(4, None, outcome="aborted", overshoot_m=1.2)
    assert deviation_range(best, latest, aborted)[1] == pytest.approx(0.891, abs=1e-3)
    assert deviation_range(flight(1, 0.4, overshoot_m=0.9), best)[1] == pytest.approx(1.1 * 0.15)
    assert deviation_range(flight(1, 0.4, overshoot_m=9.0))[1] == pytest.approx(1.5)
    assert deviation_range(following=proposal(1))[1] == pytest.approx(1.1 * 0.15)
    assert deviation_range()[1] == pytest.approx(0.6)


def test_a_landing_after_the_set_point_has_ended_does_not_widen_the_panel() -> None:
    time_s = np.linspace(0.0, 40.0, 4001)
    landed = Curve(time_s, np.where(time_s < 33.0, np.minimum(3.0, 2.0 * time_s), 0.0))
    assert deviation_range(replace(flight(1, 0.3), curve=landed))[1] == pytest.approx(1.1 * 0.15)


def test_a_deviation_that_leaves_its_panel_after_the_climb_is_marked_at_the_edge() -> None:
    flights = (flight(1, 0.4, overshoot_m=0.81), flight(2, 0.3, overshoot_m=0.8), flight(3, 0.1, overshoot_m=0.02))
    card = TrajectoriesFigure(history(*flights)).compute()
    limit = layout(card)["yaxis2"]["range"][1]
    first, second = (trace(card, "off scale deviation", trial=number) for number in (1, 2))
    assert (first["x"], first["y"], first["yaxis"]) == ([pytest.approx(2.0, abs=0.01)], [limit], "y2")
    assert (first["text"], first["mode"]) == (["1 ↑ 0.81\u00a0m"], "markers+text")
    assert first["hovertemplate"].startswith("Deviation of flight 1 reaches 0.81 m at")
    assert (second["text"], second["textposition"]) == (["2 ↑ 0.80\u00a0m"], "bottom left")
    assert {one["meta"]["trial"] for one in traces(card) if one["meta"]["role"] == "off scale deviation"} == {1, 2}
    assert card.summary.endswith("Deviation of 2 off scale, marked at the edge.")


@pytest.mark.parametrize(("at_s", "side"), [(4.0, "top right"), (7.3, "top center"), (7.9, "top left")])
def test_a_deviations_label_stays_within_the_panel_with_its_unit_and_a_true_minus(at_s: float, side: str) -> None:
    dip = np.minimum(3.0, 2.0 * TIME_S) - 0.9 * (np.abs(TIME_S - at_s) < 0.05)
    low = replace(flight(1, 0.4), curve=Curve(TIME_S, dip))
    card = TrajectoriesFigure(history(low, flight(2, 0.3), flight(3, 0.1))).compute()
    mark = trace(card, "off scale deviation", trial=1)
    assert (mark["text"], mark["textposition"]) == (["1 ↓ −0.90\u00a0m"], side)


def aborted(number: int, at_s: float) -> FlightData:
    """Never near the set point; descends from `at_s` on by 0.5 m/s until it stands on the ground."""
    values = np.clip(np.minimum(2.0, 2.0 * TIME_S) - 0.5 * np.maximum(0.0, TIME_S - at_s), 0.0, None)
    return replace(flight(number, None, outcome="aborted"), curve=Curve(TIME_S, values))


def test_each_cut_deviation_is_marked_with_its_extreme_in_the_visible_time_range() -> None:
    """Seen: −0.88 m at 8 s beside a flight that stands on the ground at 12 s, and a mark at 15.7 s in the first 8 s."""
    past = history(flight(1, 0.1), *(aborted(number, at_s) for number, at_s in ((2, 7.0), (3, 12.0), (4, 12.1))))

    def texts(window: Range | None) -> dict[int, tuple[float, str]]:
        card = TrajectoriesFigure(replace(past, window=window)).compute()
        marks = [one for one in traces(card) if one["meta"]["role"] == "off scale deviation"]
        assert f"Deviation of {len(marks)} off scale" in card.summary
        return {one["meta"]["trial"]: (one["x"][0], one["text"][0]) for one in marks}

    first = texts(None)
    assert first[2] == (8.0, "2 ↓ −1.50\u00a0m")
    assert max(x for x, _ in first.values()) <= 8.0
    whole = texts(Range(-0.3, 32.6))
    assert [whole[number][1] for number in (2, 3, 4)] == ["2 ↓ −3.00\u00a0m", "3, 4 ↓ −3.0\u00a0m", ""]
    assert [whole[number][0] for number in (2, 3, 4)] == pytest.approx([11.0, 16.0, 16.1], abs=0.02)
    assert texts(Range(20.0, 25.0))[2][0] == 20.0


def test_labels_at_opposite_edges_have_room_at_the_same_time() -> None:
    def bumped(by_m: float) -> Curve:
        return Curve(TIME_S, np.minimum(3.0, 2.0 * TIME_S) + by_m * (np.abs(TIME_S - 4.0) < 0.05))

    bumps = ((1, 0.9), (2, -0.9), (3, 0.8), (4, 0.7))
    off = [replace(flight(number, 0.4), curve=bumped(by_m)) for number, by_m in bumps]
    card = TrajectoriesFigure(history(*off, flight(5, 0.1), flight(6, 0.2))).compute()
    marks = [trace(card, "off scale deviation", trial=number) for number in (1, 2, 3, 4)]
    assert [mark["textposition"] for mark in marks[:3]] == ["bottom right", "top right", "bottom left"]
    assert (marks[3]["text"], marks[3]["mode"]) == ([""], "markers")


def test_an_error_around_zero_is_its_own_deviation() -> None:
    zero = Curve(TIME_S, np.zeros_like(TIME_S))
    card = TrajectoriesFigure(replace(history(flight(1, 0.3)), set_point=zero, reference=None)).compute()
    assert "yaxis2" not in layout(card)
    assert "deviation" not in {one["meta"]["role"] for one in traces(card)}


def test_a_baseline_flown_last_does_not_outshout_the_best() -> None:
    again = replace(flight(3, 0.3), gains=flight(1, 0.3).gains)
    card = TrajectoriesFigure(history(flight(1, 0.3), flight(2, 0.1), again)).compute()
    baseline, best = trace(card, "flight", trial=3), trace(card, "flight", trial=2)
    assert (baseline["meta"]["standing"], baseline["name"]) == ("baseline", "Flight 3 · latest, baseline")
    assert baseline["line"]["width"] < best["line"]["width"]
    assert baseline["line"]["color"] == trace(card, "flight", trial=1)["line"]["color"]


def test_one_wild_flight_is_marked_at_the_edge_and_does_not_flatten_the_others() -> None:
    card = TrajectoriesFigure(history(flight(1, 0.3), flight(2, 2.0, overshoot_m=9.0), flight(3, 0.2))).compute()
    low, high = layout(card)["yaxis"]["range"]
    assert low == pytest.approx(-0.2, abs=0.1)
    assert 3.2 < high < 4.0
    assert trace(card, "off scale", trial=2)["text"] == ["2 ↑ 12.0\u00a0m"]
    assert "1 off scale" in card.summary


def test_a_flight_that_leaves_the_scale_in_the_visible_part_is_marked_there() -> None:
    """Seen: the mark stood at the highest peak, after the first 8 s."""
    growing = Curve(
        TIME_S, np.minimum(3.0, 2.0 * TIME_S) + 0.5 * TIME_S * np.exp(-((TIME_S - 5.0) ** 2)) + (TIME_S > 20.0) * 6.0
    )
    wild = replace(flight(2, 2.0), curve=growing)
    card = TrajectoriesFigure(history(flight(1, 0.3), wild, flight(3, 0.2), flight(4, 0.21))).compute()
    assert layout(card)["yaxis"]["range"][1] < 5.0
    mark = trace(card, "off scale", trial=2)
    assert mark["x"] == [pytest.approx(5.1, abs=0.1)]
    assert mark["text"] == ["2 ↑ 5.5\u00a0m"]


def test_the_table_gives_the_same_curves_in_numbers() -> None:
    card = TrajectoriesFigure(history(flight(1, 0.3), proposal=proposal(2))).compute()
    assert card.table is not None
    assert [column.name for column in card.table.columns] == [
        "time_s",
        "set_point",
        "reference",
        "flight_1",
        "prediction",
    ]
    at_two_seconds = next(row for row in card.table.rows if row[0] == 2.0)
    assert list(at_two_seconds) == pytest.approx([2.0, 3.0, 2.0, 3.3, 3.1], abs=1e-4)


def test_a_record_that_ends_early_leaves_gaps_in_the_table_instead_of_inventing_numbers() -> None:
    short = Curve(TIME_S[:300], climb(0.3).values[:300])
    assert short.at(2.0) == pytest.approx(3.3)
    assert short.at(20.0) is None


def test_many_flights_share_the_points_so_that_the_figure_stays_small() -> None:
    card = TrajectoriesFigure(history(*(flight(number, 0.3) for number in range(1, 201)))).compute()
    assert sum(len(one["x"]) for one in traces(card)) <= 14_000


def test_thinning_keeps_the_extremes_of_a_curve() -> None:
    x, y = thinned(climb(0.3), 100)
    assert len(x) <= 100
    assert max(y) == pytest.approx(climb(0.3).values.max(), abs=1e-4)
    assert (x[0], x[-1]) == (0.0, 32.6)


@pytest.mark.parametrize(
    ("peaks", "outside"),
    [
        ([], []),
        ([3.4], []),
        ([3.4, 3.5, 3.3], []),
        ([3.4, 9.0], [1]),
        ([9.0, 3.4, 3.5, 30.0, 3.3], [0, 3]),
    ],
)
def test_the_robust_range_leaves_out_outliers_only(peaks: list[float], outside: list[int]) -> None:
    top, found = robust_top(peaks, low=0.0, high=float(SET_POINT.values.max()))
    assert found == outside
    assert top >= max([3.0, *(peak for index, peak in enumerate(peaks) if index not in outside)])


def test_both_themes_draw_the_same_values_in_different_colours() -> None:
    light, dark = (
        TrajectoriesFigure(history(flight(1, 0.3)), theme_name=theme).compute() for theme in ("light", "dark")
    )
    assert trace(light, "flight", trial=1)["y"] == trace(dark, "flight", trial=1)["y"]
    assert trace(light, "flight", trial=1)["line"]["color"] != trace(dark, "flight", trial=1)["line"]["color"]


def test_with_later_set_points_it_opens_at_them_and_deviations_are_from_the_reference() -> None:
    steps = Curve(TIME_S, np.where(TIME_S < 10.0, 3.0, 2.0))
    reference = Curve(TIME_S, 2.0 + np.exp(-np.maximum(TIME_S - 10.0, 0.0)))
    flown = replace(flight(1, 0.3), curve=Curve(TIME_S, reference.values + 0.1))
    stepped = replace(history(flown), set_point=steps, reference=reference, by_reference=True)
    card = TrajectoriesFigure(stepped).compute()
    assert [one["meta"]["role"] for one in traces(card)][:2] == ["set point", "target"]
    assert layout(card)["xaxis"]["range"] == [pytest.approx(9.0, abs=0.1), TIME_S[-1]]
    assert layout(card)["meta"]["opening"] == "Steps"
    assert trace(card, "deviation", trial=1)["y"] == pytest.approx([0.1] * len(trace(card, "deviation", trial=1)["y"]))


def test_without_a_reference_deviations_stay_those_from_the_set_point() -> None:
    card = TrajectoriesFigure(replace(history(flight(1, 0.3)), reference=None, by_reference=True)).compute()
    assert trace(card, "target")["name"] == "Set point"
