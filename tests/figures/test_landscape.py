"""Contours that one cliff cannot flatten, and a path whose numbers can be read."""

from dataclasses import replace

import pytest

from app.core.tuning.landscape import Landscape, Slice
from app.figures.landscape import LandscapeFigure, Search, Tried, lowest
from app.figures.slices import Box, Scale, mark_box, number_box, number_position, place_labels, scale_of
from tests.figures.builders import flight, history, proposal, trace

VALUES = tuple(float(value) for value in range(10))
BOWL = tuple(tuple(0.1 + 0.01 * ((x - 4) ** 2 + (y - 6) ** 2) for x in VALUES) for y in VALUES)
CENTRE = {"kp": 281.0, "ki": 10.0, "kd": 80.0}


def cliff(error: float | None) -> Slice:
    """A bowl whose first row fell off the model."""
    return Slice(x="kp", y="ki", x_values=VALUES, y_values=VALUES, errors=((error,) * 10, *BOWL[1:]))


def test_a_cliff_does_not_set_the_scale() -> None:
    scale = scale_of([cliff(1e6)])
    assert scale.low <= 0.1
    assert 0.2 < scale.high < 1.0
    assert 4 <= (scale.high - scale.low) / scale.step <= 12


def test_points_without_a_finite_error_stay_empty() -> None:
    gains, error = lowest(cliff(None), CENTRE)
    assert gains == {"kp": 4.0, "ki": 6.0, "kd": 80.0}
    assert error == pytest.approx(0.1)


def test_flights_of_one_place_share_a_number_and_the_line_ends_at_the_edge() -> None:
    land = Landscape(centre={"kp": 4.0, "ki": 6.0, "kd": 80.0}, slices=(cliff(None),))
    search = Search(
        gradient={"kp": 1.0},
        direction={"kp": -2.0, "ki": 1.0, "kd": 0.0},
        tried=(Tried({"kp": 2, "ki": 7, "kd": 80}, 0.2),),
    )
    flown = history(flight(1, 0.3), flight(2, 0.2), proposal=proposal(3))
    twice = history(flown.flights[0], flown.flights[0], flown.flights[1])
    card = LandscapeFigure(flown, land, search).compute()
    assert trace(card, "path")["text"] == ["1", "2"]
    assert (trace(card, "line")["x"], trace(card, "line")["y"]) == ([4.0, 0.0], [6.0, 8.0])
    assert (trace(card, "tried")["x"], trace(card, "proposed")["x"]) == ([2], [500])
    assert trace(LandscapeFigure(twice, land, search).compute(), "path")["text"] == ["1", "", "2"]


def test_numbers_that_would_cover_each_other_are_left_out_but_never_the_first_best_and_latest() -> None:
    land = Landscape(centre={"kp": 4.0, "ki": 6.0, "kd": 80.0}, slices=(cliff(None),))
    places = ((1.0, 1.0), (1.2, 1.2), (5.0, 5.0), (5.1, 5.2), (1.1, 1.1), (5.2, 5.1))
    flights = [
        replace(flight(number, error), gains={"kp": kp, "ki": ki, "kd": 80.0})
        for number, (error, (kp, ki)) in enumerate(
            zip((0.3, 0.2, 0.25, 0.24, 0.26, 0.27), places, strict=True), start=1
        )
    ]
    card = LandscapeFigure(history(*flights), land, Search(gradient={}, direction={})).compute()
    assert trace(card, "path")["text"] == ["1, 2", "", "", "", "", "6"]
    spread = [replace(one, gains={**one.gains, "kp": float(one.number)}) for one in flights]
    card = LandscapeFigure(history(*spread), land, Search(gradient={}, direction={})).compute()
    assert trace(card, "path")["text"] == ["1", "2", "3", "4", "5", "6"]
    covering = history(*spread, proposal=replace(proposal(7), gains={"kp": 4.1, "ki": 5.2, "kd": 80.0}))
    card = LandscapeFigure(covering, land, Search(gradient={}, direction={})).compute()
    assert trace(card, "path")["text"] == ["1", "2", "3", "", "5", "6"]


def test_a_number_below_its_mark_and_one_above_the_next_mark_do_not_overlap() -> None:
    land = Landscape(centre={"kp": 4.0, "ki": 6.0, "kd": 80.0}, slices=(cliff(None),))
    places = ((1.0, 1.0), (8.0, 9.0), (8.0, 7.9), (5.0, 5.0))
    flights = [
        replace(flight(number, 0.3 - 0.01 * number), gains={"kp": kp, "ki": ki, "kd": 80.0})
        for number, (kp, ki) in enumerate(places, start=1)
    ]
    card = LandscapeFigure(history(*flights), land, Search(gradient={}, direction={})).compute()
    assert trace(card, "path")["text"] == ["1", "2", "", "4"]


def error_at(label: Box) -> float:
    x, y = (9.0 * share for share in label.centre)
    return 0.1 + 0.01 * ((x - 4) ** 2 + (y - 6) ** 2)


def test_each_contour_is_labelled_on_itself_where_no_flight_number_or_mark_is() -> None:
    one, scale = Slice(x="kp", y="ki", x_values=VALUES, y_values=VALUES, errors=BOWL), Scale(0.1, 0.4, 0.05)
    flown = [{"kp": float(kp), "ki": float(ki), "kd": 80.0} for kp, ki in ((6, 6), (4, 8), (2, 6), (4, 4), (7, 7))]
    taken = [mark_box(one, gains) for gains in flown] + [number_box(one, gains, "1, 2") for gains in flown]
    labels = place_labels(one, scale, taken)
    assert list(labels) == ["0.15", "0.2", "0.25", "0.3", "0.35", "0.4"]
    for text, label in labels.items():
        assert error_at(label) == pytest.approx(float(text), abs=0.0025)  # linear between points of a parabola
        others = [other for other in labels.values() if other is not label]
        assert label.clearance([*taken, *others]) > 0.0


def test_a_contour_without_a_free_point_has_no_label() -> None:
    one, scale = Slice(x="kp", y="ki", x_values=VALUES, y_values=VALUES, errors=BOWL), Scale(0.1, 0.4, 0.05)
    left_half = Box((0.25, 0.5), (0.5, 1.0))
    labels = place_labels(one, scale, [left_half])
    assert labels != {}
    assert all(label.centre[0] > 0.5 for label in labels.values())
    assert place_labels(one, scale, [Box((0.5, 0.5), (1.0, 1.0))]) == {}


@pytest.mark.parametrize(
    ("kp", "ki", "text", "position"),
    [
        (5.0, 5.0, "1, 4", "top center"),
        (9.0, 5.0, "2, 3", "top left"),
        (0.0, 5.0, "1, 4", "top right"),
        (0.0, 9.0, "1", "bottom right"),
        (9.0, 9.0, "2, 3", "bottom left"),
    ],
)
def test_numbers_at_the_edge_stand_within_the_slice(kp: float, ki: float, text: str, position: str) -> None:
    assert number_position(cliff(None), {"kp": kp, "ki": ki, "kd": 80.0}, text) == position
