"""What several figures draw over or instead of single flights: a prediction's band, glitches, triangles at the edge for
flights that leave the scale, and for many flights the envelope that represents those not drawn individually.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from app.core.records.trajectory import Samples
from app.figures import theme
from app.figures.base import Trace, reading, scatter
from app.figures.data import NO_CURVE, Band, Curve, FlightData, History, Points, Range, thin_by_bends, thinned

GLITCH_POINTS: Final = 60
Side = Literal["left", "center", "right"]
"""Where a label is, seen from its mark."""


def band_traces(palette: theme.Palette, band: Band | None) -> Iterator[Trace]:
    """The predicted band of a flight: two traces (`meta` role band, edge lower and upper), none without a band."""
    if band is None:
        return
    edge, fill = (theme.with_opacity(palette.prediction, opacity) for opacity in (0.35, 0.14))
    edges = [thin_by_bends(curve) for curve in (band.lower, band.upper)]
    yield from _filled("band", ("Likely, lower edge", "Likely"), edges, edge, fill, 900)


def _filled(
    role: str, names: tuple[str, str], edges: Sequence[Points], edge: str, fill: str, rank: int
) -> Iterator[Trace]:
    """Lower and upper edge in the colour `edge`, and what is between them in the colour `fill`."""
    (lower, upper), line = edges, theme.line(edge, 0.75)
    style: dict[str, Any] = {"role": role, "line": line, "legendgroup": role, "legendrank": rank}
    yield scatter(names[0], lower, about={"edge": "lower"}, showlegend=False, **style)
    yield scatter(names[1], upper, about={"edge": "upper"}, fill="tonexty", fillcolor=fill, **style)


def glitch_traces(
    palette: theme.Palette, number: int, curve: Curve, glitches: Sequence[Range], unit: str
) -> Iterator[Trace]:
    """The glitches of a flight's record, over its curve: one trace, or none."""
    if not glitches:
        return
    x: list[float | None] = []
    y: list[float | None] = []
    for glitch in glitches:
        around = slice(*glitch.slice_of(curve.time_s))  # with the samples before and after it, so that a gap shows
        time_s, values = thinned(curve.part(around), GLITCH_POINTS)
        x, y = [*x, *time_s, None], [*y, *values, None]
    yield scatter(
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


def triangle(
    name: str,
    at: tuple[float, float],
    colour: str,
    *,
    trial: int,
    label: str,
    up: bool = True,
    side: Side = "center",
    role: str = "off scale",
    **more: object,
) -> Trace:
    """A triangle at the upper or lower edge of the scale, with its label, if any, to the `side` of it."""
    return scatter(
        name,
        ([at[0]], [at[1]]),
        role=role,
        about={"trial": trial},
        mode="markers+text" if label else "markers",
        text=[label],
        textposition=f"{'bottom' if up else 'top'} {side}",
        marker={"symbol": "triangle-up" if up else "triangle-down", "size": 12, "color": colour},
        textfont={"color": colour, "shadow": "auto"},  # curves may cross it: with an outline in the opposite tone
        showlegend=False,
        cliponaxis=False,
        hovertemplate=f"{name}<extra></extra>",
        **more,
    )


def part_off_scale(curve: Curve, low: float, high: float, window: Range) -> Curve:
    """The part of a curve in the visible time range `window`, if it leaves the scale `low` … `high`; else no curve."""
    part = curve.part((window.low <= curve.time_s) & (curve.time_s <= window.high))
    return part if part and (part.values.max() > high or part.values.min() < low) else NO_CURVE


def leaves_upward(values: Samples, low: float, high: float) -> bool:
    """Whether what leaves the scale `low` … `high` is farther above than below it."""
    return bool(values.max() - high >= low - values.min())


def signed(value: float, digits: int) -> str:
    """A number with a true minus."""
    return f"{value:.{digits}f}".replace("-", "−")


def off_scale(
    label: str,
    curve: Curve,
    low: float,
    high: float,
    colour: str,
    *,
    trial: int,
    text: str,
    unit: str,
    digits: int = 1,
    **more: Any,
) -> Trace:
    """A triangle at the edge where a flight leaves the scale `low` … `high`: with its `label`, if there is one, also
    its peak value is printed."""
    values = curve.values
    up = leaves_upward(values, low, high)
    peak = int(values.argmax() if up else values.argmin())
    name = f"{text} reaches {signed(values[peak], 2)} {unit} at {curve.time_s[peak]:.1f} s"
    return triangle(
        name,
        (round(float(curve.time_s[peak]), 3), high if up else low),
        colour,
        trial=trial,
        label=label and f"{label} {'↑' if up else '↓'} {signed(values[peak], digits)}\u00a0{unit}",
        up=up,
        **more,
    )


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
    """Curves below which lie 10, 50 and 90 % of `flights` at each time (`PERCENTILES`)."""

    curves: tuple[Curve, ...]
    flights: int


def select_individual_flights(history: History) -> frozenset[int]:
    """Numbers of the flights drawn as individual curves.

    All, if there are few; of many, the first, the best and the next best, the latest, and the `chosen` one.
    """
    if len(history.flights) <= MAX_INDIVIDUAL_FLIGHTS:
        return frozenset(flight.number for flight in history.flights)
    ranked = sorted(history.valid, key=lambda flight: (flight.error, flight.number))
    emphasised = [*history.flights[:1], *history.flights[-LATEST:], *ranked[: NEAR_BEST + 1]]
    asked = [flight for flight in history.flights if flight.number == history.chosen]
    return frozenset(flight.number for flight in (*emphasised, *asked))


def envelope_of(flights: Sequence[FlightData], until_s: float) -> Envelope | None:
    """Envelope of the valid flights' curves from the command to `until_s`; None without any.

    Times are denser while the flights climb; after the end of a record its last value holds.
    """
    curves = [flight.curve for flight in flights if flight.outcome == "valid" and flight.curve]
    if not curves:
        return None
    early = np.linspace(0.0, _EARLY_SHARE * until_s, _EARLY, endpoint=False)
    instants = np.concatenate([early, np.linspace(_EARLY_SHARE * until_s, until_s, _EVENLY)])
    table = np.array([np.interp(instants, curve.time_s, curve.values) for curve in curves])
    parts = np.percentile(table, PERCENTILES, axis=0)
    return Envelope(curves=tuple(Curve(instants, values) for values in parts), flights=len(curves))


def envelope_traces(palette: theme.Palette, envelope: Envelope | None, unit: str) -> Iterator[Trace]:
    """Two edges with the band between them, and the median (`meta` role envelope, edge lower, upper and middle)."""
    if envelope is None:
        return
    lower, median, upper = map(_points, envelope.curves)
    names, fill = ("Lower edge", f"80\u00a0% of {envelope.flights} flights"), theme.with_opacity(palette.earlier, 0.3)
    yield from _filled("envelope", names, (lower, upper), palette.earlier, fill, 800)
    yield scatter(
        "Median",
        median,
        role="envelope",
        about={"edge": "middle"},
        line=theme.line(palette.earlier, 1.5, "longdash"),
        legendgroup="median",
        legendrank=800,
        hovertemplate=reading(f"Median of {envelope.flights} flights", unit),
    )


def _points(curve: Curve) -> Points:
    return [round(at, 3) for at in curve.time_s.tolist()], [round(value, 4) for value in curve.values.tolist()]
