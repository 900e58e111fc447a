"""Many flights in one drawing: which are worth a curve of their own, and the envelope that stands for the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.trajectory import Samples
from app.figures import theme
from app.figures.history import Band, Curve, FlightData, History
from app.figures.theme import Palette

MAX_INDIVIDUAL_FLIGHTS: Final = 30
"""Up to so many flights each is drawn by itself."""
MANY: Final = 120
"""From more flights than this on, marks over the flights' numbers are small and bare."""
NEAR_BEST: Final = 5
LATEST: Final = 3
PERCENTILES: Final = (10.0, 50.0, 90.0)
_EVENLY: Final = 160
_EARLY: Final = 80
_EARLY_SHARE: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Between which curves 80 % of `flights` lay at each instant, and the curve that half of them stayed below."""

    band: Band
    median: Curve
    flights: int


def select_individual_flights(history: History, chosen: int | None = None) -> frozenset[int]:
    """Numbers of the flights with curves of their own: all of a few; of many the first, the best and those next to it,
    the latest, and the `chosen` one."""
    if len(history.flights) <= MAX_INDIVIDUAL_FLIGHTS:
        return frozenset(flight.number for flight in history.flights)
    ranked = sorted(history.valid, key=lambda flight: (flight.error, flight.number))
    emphasised = [*history.flights[:1], *history.flights[-LATEST:], *ranked[: NEAR_BEST + 1]]
    asked = [flight for flight in history.flights if flight.number == chosen]
    return frozenset(flight.number for flight in (*emphasised, *asked))


def envelope_of(flights: Sequence[FlightData], until_s: float) -> Envelope | None:
    """Of the valid ones' curves from the command to `until_s`; None without any. Instants lie closer while the flights
    climb; where a record has ended its last value stands."""
    curves = [flight.curve for flight in flights if flight.outcome == "valid" and flight.curve is not None]
    curves = [curve for curve in curves if len(curve.time_s)]
    if not curves:
        return None
    instants = _instants(until_s)
    table: NDArray[np.float64] = np.array([np.interp(instants, curve.time_s, curve.values) for curve in curves])
    lower, middle, upper = np.percentile(table, PERCENTILES, axis=0)
    band = Band(lower=Curve(instants, lower), upper=Curve(instants, upper))
    return Envelope(band=band, median=Curve(instants, middle), flights=len(curves))


def envelope_traces(palette: Palette, envelope: Envelope | None, unit: str) -> list[dict[str, object]]:
    """Two edges with the band between them, and the middle (`meta` role envelope, edge lower, upper and middle)."""
    if envelope is None:
        return []
    quiet: dict[str, object] = {"type": "scatter", "mode": "lines", "legendgroup": "envelope", "legendrank": 800}
    edge = quiet | {"line": theme.line(palette.earlier, 0.75), "hoverinfo": "skip"}
    name = f"80\u00a0% of {envelope.flights} flights"
    return [
        edge
        | _points(envelope.band.lower)
        | {"name": "Lower edge", "showlegend": False, "meta": {"role": "envelope", "edge": "lower"}},
        edge
        | _points(envelope.band.upper)
        | {
            "name": name,
            "fill": "tonexty",
            "fillcolor": theme.with_opacity(palette.earlier, 0.3),
            "meta": {"role": "envelope", "edge": "upper"},
        },
        quiet
        | _points(envelope.median)
        | {
            "name": "Median",
            "line": theme.line(palette.earlier, 1.5, "longdash"),
            "meta": {"role": "envelope", "edge": "middle"},
            "legendgroup": "median",
            "hovertemplate": f"<b>Median of {envelope.flights} flights</b><br>%{{x:.2f}} s · %{{y:.3f}} {unit}"
            "<extra></extra>",
        },
    ]


def _instants(until_s: float) -> Samples:
    early = np.linspace(0.0, _EARLY_SHARE * until_s, _EARLY, endpoint=False)
    return np.concatenate([early, np.linspace(_EARLY_SHARE * until_s, until_s, _EVENLY)])


def _points(curve: Curve) -> dict[str, object]:
    return {
        "x": [round(at, 3) for at in curve.time_s.tolist()],
        "y": [round(value, 4) for value in curve.values.tolist()],
    }
