"""Marks of flights whose error exceeds the scale: triangles at the upper edge.

This keeps the other flights readable when one is an outlier.
"""

from collections.abc import Iterator, Sequence
from typing import Final

from app.figures.history import FlightData
from app.figures.theme import Palette

PRINT: Final = 0.18
"""Width of a printed error on a phone, as a share of the axis."""


def off_scale_traces(
    palette: Palette, flights: Sequence[FlightData], top: float, unit: str, *, last: int, crowded: bool
) -> list[dict[str, object]]:
    """Marks at height `top` of an axis that ends with flight `last`.

    If there are few flights, with the errors that have room.
    """
    if crowded:
        return [_together(palette, flights, top, unit)] if flights else []
    printed = set(_with_room([flight.number for flight in flights], PRINT * last))
    return [_alone(palette, flight, top, unit, in_print=flight.number in printed) for flight in flights]


def _with_room(numbers: Sequence[int], room: float) -> Iterator[int]:
    """Of ascending numbers, those at least `room` away from the last one selected."""
    free = 0.0
    for number in numbers:
        if number >= free:
            free = number + room
            yield number


def _alone(palette: Palette, flight: FlightData, top: float, unit: str, *, in_print: bool) -> dict[str, object]:
    text = f"Flight {flight.number}: {flight.error:.2f} {unit}"
    return {
        "type": "scatter",
        "mode": "markers+text" if in_print else "markers",
        "name": text,
        "x": [flight.number],
        "y": [top],
        "text": [f"↑ {flight.error:.2f}" if in_print else ""],
        "textposition": "bottom center",
        "showlegend": False,
        "marker": {"symbol": "triangle-up", "size": 12, "color": palette.bad},
        "textfont": {"color": palette.bad},
        "cliponaxis": False,
        "meta": {"role": "off scale", "trial": flight.number},
        "hovertemplate": f"{text}<extra></extra>",
    }


def _together(palette: Palette, flights: Sequence[FlightData], top: float, unit: str) -> dict[str, object]:
    """Many flights in one trace, without printed errors."""
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
