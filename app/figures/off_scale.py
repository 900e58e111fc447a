"""Flights whose error lies beyond the scale: triangles at the upper edge, so that one wild flight flattens no other."""

from collections.abc import Sequence

from app.figures.history import FlightData
from app.figures.theme import Palette


def off_scale_traces(
    palette: Palette, flights: Sequence[FlightData], top: float, unit: str, *, crowded: bool
) -> list[dict[str, object]]:
    """At height `top`, of few flights each with its error in print."""
    if crowded:
        return [_together(palette, flights, top, unit)] if flights else []
    return [_alone(palette, flight, top, unit) for flight in flights]


def _alone(palette: Palette, flight: FlightData, top: float, unit: str) -> dict[str, object]:
    text = f"Flight {flight.number}: {flight.error:.2f} {unit}"
    return {
        "type": "scatter",
        "mode": "markers+text",
        "name": text,
        "x": [flight.number],
        "y": [top],
        "text": [f"↑ {flight.error:.2f}"],
        "textposition": "bottom center",
        "showlegend": False,
        "marker": {"symbol": "triangle-up", "size": 12, "color": palette.bad},
        "textfont": {"color": palette.bad},
        "cliponaxis": False,
        "meta": {"role": "off scale", "trial": flight.number},
        "hovertemplate": f"{text}<extra></extra>",
    }


def _together(palette: Palette, flights: Sequence[FlightData], top: float, unit: str) -> dict[str, object]:
    """Many in one trace, without their errors in print."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "Off the scale",
        "x": [flight.number for flight in flights],
        "y": [top] * len(flights),
        "text": [f"{flight.error:.2f} {unit}" for flight in flights],
        "marker": {"symbol": "triangle-up", "size": 8, "color": palette.bad},
        "cliponaxis": False,
        "meta": {"role": "off scale"},
        "hovertemplate": "<b>Flight %{x}</b><br>error %{text}<extra></extra>",
    }
