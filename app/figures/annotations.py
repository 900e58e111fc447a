"""Overlays shared by several figures: a prediction's band, glitches, and triangles at the upper edge for flights whose
error exceeds the scale, so that the others stay readable when one is an outlier.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from app.figures import theme
from app.figures.base import Trace, reading, scatter
from app.figures.data import Band, Curve, FlightData, Range
from app.figures.scale import thin_by_bends, thinned
from app.figures.theme import Palette

GLITCH_POINTS: Final = 60


def band_traces(palette: Palette, band: Band | None) -> list[Trace]:
    """The predicted band of a flight: two traces (`meta` role band, edge lower and upper), none without a band."""
    if band is None:
        return []
    quiet: dict[str, Any] = {
        "line": theme.line(theme.with_opacity(palette.prediction, 0.35), 0.75),
        "legendgroup": "band",
        "legendrank": 900,
    }
    lower, upper = (thin_by_bends(curve.time_s, curve.values) for curve in (band.lower, band.upper))
    fill: dict[str, Any] = {"fill": "tonexty", "fillcolor": theme.with_opacity(palette.prediction, 0.14)}
    return [
        scatter("Likely, lower edge", lower, role="band", about={"edge": "lower"}, showlegend=False, **quiet),
        scatter("Likely", upper, role="band", about={"edge": "upper"}, **fill, **quiet),
    ]


def glitch_traces(
    palette: Palette, number: int, curve: Curve | None, glitches: Sequence[Range], unit: str
) -> list[Trace]:
    """The glitches of a flight's record, over its curve: one trace, or none."""
    if curve is None or not glitches:
        return []
    x: list[float | None] = []
    y: list[float | None] = []
    for glitch in glitches:
        time_s, values = _stretch(curve, glitch)
        x, y = [*x, *time_s, None], [*y, *values, None]
    return [
        scatter(
            f"Flight {number}, glitch",
            (x[:-1], y[:-1]),
            role="glitch",
            about={"trial": number},
            mode="lines+markers",
            line=theme.line(palette.bad, 5),
            marker={"symbol": "x-thin", "size": 9, "line": {"width": 2, "color": palette.bad}},
            opacity=0.85,
            showlegend=False,
            hovertemplate=reading(f"Flight {number}, glitch", unit),
        )
    ]


def _stretch(curve: Curve, part: Range) -> tuple[list[float], list[float]]:
    """Part of a curve, with the samples just before and after it, so that a gap is visible."""
    first, end = part.slice_of(curve.time_s)
    return thinned(curve.time_s[first:end], curve.values[first:end], GLITCH_POINTS)


PRINT: Final = 0.18
"""Width of a printed error on a phone, as a share of the axis."""


def off_scale_traces(
    palette: Palette, flights: Sequence[FlightData], top: float, unit: str, *, last: int, crowded: bool
) -> list[Trace]:
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


def _alone(palette: Palette, flight: FlightData, top: float, unit: str, *, in_print: bool) -> Trace:
    text = f"Flight {flight.number}: {flight.error:.2f} {unit}"
    return scatter(
        text,
        ([flight.number], [top]),
        role="off scale",
        about={"trial": flight.number},
        mode="markers+text" if in_print else "markers",
        text=[f"↑ {flight.error:.2f}" if in_print else ""],
        textposition="bottom center",
        showlegend=False,
        marker={"symbol": "triangle-up", "size": 12, "color": palette.bad},
        textfont={"color": palette.bad},
        cliponaxis=False,
        hovertemplate=f"{text}<extra></extra>",
    )


def _together(palette: Palette, flights: Sequence[FlightData], top: float, unit: str) -> Trace:
    """Many flights in one trace, without printed errors."""
    return scatter(
        "Off scale",
        ([flight.number for flight in flights], [top] * len(flights)),
        role="off scale",
        mode="markers",
        text=[f"{flight.error:.2f} {unit}" for flight in flights],
        marker={"symbol": "triangle-up", "size": 8, "color": palette.bad},
        cliponaxis=False,
        hovertemplate="<b>Flight %{x}</b><br>error %{text}<extra></extra>",
    )
