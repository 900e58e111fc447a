"""Figures with many flights: which are drawn as individual curves, and the envelope that represents the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from app.core.records.trajectory import Samples
from app.figures import theme
from app.figures.base import Trace, reading, scatter
from app.figures.data import Band, Curve, FlightData, History
from app.figures.theme import Palette

MAX_INDIVIDUAL_FLIGHTS: Final = 30
"""Up to this number, every flight is drawn individually."""
MANY: Final = 120
"""With more flights than this, marks over the flight numbers are small, without error bars or labels."""
NEAR_BEST: Final = 5
LATEST: Final = 3
PERCENTILES: Final = (10.0, 50.0, 90.0)
_EVENLY: Final = 160
_EARLY: Final = 80
_EARLY_SHARE: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """The band that contains 80 % of `flights` at each time, and their median curve."""

    band: Band
    median: Curve
    flights: int


def select_individual_flights(history: History, chosen: int | None = None) -> frozenset[int]:
    """Numbers of the flights drawn as individual curves.

    All, if there are few; of many, the first, the best and the next best, the latest, and the `chosen` one.
    """
    if len(history.flights) <= MAX_INDIVIDUAL_FLIGHTS:
        return frozenset(flight.number for flight in history.flights)
    ranked = sorted(history.valid, key=lambda flight: (flight.error, flight.number))
    emphasised = [*history.flights[:1], *history.flights[-LATEST:], *ranked[: NEAR_BEST + 1]]
    asked = [flight for flight in history.flights if flight.number == chosen]
    return frozenset(flight.number for flight in (*emphasised, *asked))


def envelope_of(flights: Sequence[FlightData], until_s: float) -> Envelope | None:
    """Envelope of the valid flights' curves from the command to `until_s`; None without any.

    Times are denser while the flights climb; after the end of a record its last value holds.
    """
    curves = [flight.curve for flight in flights if flight.outcome == "valid" and flight.curve is not None]
    curves = [curve for curve in curves if len(curve.time_s)]
    if not curves:
        return None
    instants = _instants(until_s)
    table: NDArray[np.float64] = np.array([np.interp(instants, curve.time_s, curve.values) for curve in curves])
    lower, middle, upper = np.percentile(table, PERCENTILES, axis=0)
    band = Band(lower=Curve(instants, lower), upper=Curve(instants, upper))
    return Envelope(band=band, median=Curve(instants, middle), flights=len(curves))


def envelope_traces(palette: Palette, envelope: Envelope | None, unit: str) -> list[Trace]:
    """Two edges with the band between them, and the median (`meta` role envelope, edge lower, upper and middle)."""
    if envelope is None:
        return []
    edge: dict[str, Any] = {"line": theme.line(palette.earlier, 0.75), "legendgroup": "envelope", "legendrank": 800}
    fill: dict[str, Any] = {"fill": "tonexty", "fillcolor": theme.with_opacity(palette.earlier, 0.3)}
    name = f"80\u00a0% of {envelope.flights} flights"
    lower, upper, median = map(_points, (envelope.band.lower, envelope.band.upper, envelope.median))
    return [
        scatter("Lower edge", lower, role="envelope", about={"edge": "lower"}, showlegend=False, **edge),
        scatter(name, upper, role="envelope", about={"edge": "upper"}, **fill, **edge),
        scatter(
            "Median",
            median,
            role="envelope",
            about={"edge": "middle"},
            line=theme.line(palette.earlier, 1.5, "longdash"),
            legendgroup="median",
            legendrank=800,
            hovertemplate=reading(f"Median of {envelope.flights} flights", unit),
        ),
    ]


def _instants(until_s: float) -> Samples:
    early = np.linspace(0.0, _EARLY_SHARE * until_s, _EARLY, endpoint=False)
    return np.concatenate([early, np.linspace(_EARLY_SHARE * until_s, until_s, _EVENLY)])


def _points(curve: Curve) -> tuple[list[float], list[float]]:
    return [round(at, 3) for at in curve.time_s.tolist()], [round(value, 4) for value in curve.values.tolist()]
