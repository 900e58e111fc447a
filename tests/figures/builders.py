"""Histories with curves simple enough to check by hand."""

import json
from typing import Any

import numpy as np

from app.core.definition import Interval
from app.core.policy import Gain
from app.figures.base import Card
from app.figures.data import Band, Curve, FlightData, History, NextFlight, Noise, Outcome, Range

TIME_S = np.linspace(0.0, 32.6, 3261)
SET_POINT = Curve(TIME_S, np.full_like(TIME_S, 3.0))
REFERENCE = Curve(TIME_S, np.minimum(3.0, TIME_S))
GAINS = (
    Gain("kp", "Proportional gain", "counts", 0, 4000, 400, 283, True),
    Gain("ki", "Integral gain", "counts", 0, 1073, 107.3, 13, True),
    Gain("kd", "Derivative gain", "counts", 0, 409, 40.9, 82, True),
)


def climb(overshoot_m: float) -> Curve:
    """Rises to 3 m, with one overshoot of the given height at 2 s."""
    return Curve(TIME_S, np.minimum(3.0, 2.0 * TIME_S) + overshoot_m * np.exp(-((TIME_S - 2.0) ** 2)))


def flight(
    number: int,
    error: float | None,
    *,
    outcome: Outcome = "valid",
    overshoot_m: float = 0.3,
    predicted_error: float | None = None,
    interval: Interval | None = None,
    glitches: tuple[Range, ...] = (),
) -> FlightData:
    return FlightData(
        number=number,
        gains={"kp": 280 + number, "ki": 10 * number, "kd": 80},
        outcome=outcome,
        curve=climb(overshoot_m),
        error=error,
        predicted_error=predicted_error,
        interval=interval,
        glitches=glitches,
    )


def history(
    *flights: FlightData,
    proposal: NextFlight | None = None,
    improvement: float | None = 0.05,
    noise: Noise | None = None,
) -> History:
    return History(
        output_title="Altitude",
        output_unit="m",
        error_unit="m",
        gains=GAINS,
        set_point=SET_POINT,
        reference=REFERENCE,
        flights=flights,
        proposal=proposal,
        stop_improvement=improvement,
        noise=noise,
    )


def proposal(number: int, *, interval: Interval | None = None, band_m: float | None = None) -> NextFlight:
    """Expected to overshoot by 0.1 m, within ± `band_m` all along."""
    curve = climb(0.1)
    band = (
        None
        if band_m is None
        else Band(lower=Curve(TIME_S, curve.values - band_m), upper=Curve(TIME_S, curve.values + band_m))
    )
    return NextFlight(
        number=number,
        gains={"kp": 500, "ki": 200, "kd": 90},
        curve=curve,
        predicted_error=0.12,
        band=band,
        interval=interval,
    )


def traces(card: Card) -> list[dict[str, Any]]:
    """The card's traces, as a browser would get them."""
    assert card.figure is not None, card.reason
    data: list[dict[str, Any]] = json.loads(json.dumps(card.figure["data"]))
    return data


def trace(card: Card, role: str, **meta: object) -> dict[str, Any]:
    """The only trace of that role (and further `meta`)."""
    [found] = [one for one in traces(card) if one["meta"].items() >= {"role": role, **meta}.items()]
    return found


def layout(card: Card) -> dict[str, Any]:
    assert card.figure is not None, card.reason
    found: dict[str, Any] = json.loads(json.dumps(card.figure["layout"]))
    return found
