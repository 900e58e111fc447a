"""Contours that one cliff cannot flatten, and a path of numbered flights."""

from dataclasses import replace

import pytest

from app.core.tuning.landscape import Landscape, Slice
from app.figures.landscape import LandscapeFigure, lowest, scale_of
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


LAND = Landscape(centre={"kp": 4.0, "ki": 6.0, "kd": 80.0}, slices=(cliff(None),))


def test_the_path_the_tried_and_the_proposed_gains_are_projected_onto_the_slice() -> None:
    flown = history(flight(1, 0.3), flight(2, 0.2), proposal=proposal(3))
    card = LandscapeFigure(flown, LAND, ({"kp": 2, "ki": 7, "kd": 80},)).compute()
    assert (trace(card, "tried")["x"], trace(card, "tried")["y"]) == ([2], [7])
    assert trace(card, "proposed")["x"] == [500]
    assert trace(card, "path")["x"] == [each.gains["kp"] for each in flown.flights]


def test_the_first_the_best_and_the_latest_flight_are_numbered_together_where_they_have_one_place() -> None:
    places = ((1.0, 1.0), (1.2, 1.2), (5.0, 5.0), (1.0, 1.0))
    flights = [
        replace(flight(number, error), gains={"kp": kp, "ki": ki, "kd": 80.0})
        for number, (error, (kp, ki)) in enumerate(zip((0.3, 0.2, 0.25, 0.24), places, strict=True), start=1)
    ]
    card = LandscapeFigure(history(*flights), LAND).compute()
    assert trace(card, "path")["text"] == ["1, 4", "2", "", ""]
