"""All flights over set point and reference trajectory: the best emphasised, the next one's prediction dashed."""

from dataclasses import dataclass
from typing import ClassVar, Final

from app.core.formatting import count
from app.figures import theme
from app.figures.annotations import band_traces, glitch_traces
from app.figures.base import Card, Cell, Column, Table, plotly_json
from app.figures.data import Curve, FlightData, History
from app.figures.many_flights import PERCENTILES, Envelope, envelope_of, envelope_traces, select_individual_flights
from app.figures.scale import robust_span, thin_by_bends, thinned
from app.figures.theme import PALETTES, Palette, ThemeName

CURVE_POINTS: Final = 500
ALL_POINTS: Final = 12_000
HEADROOM: Final = 1.15
"""Room above the set point for the next flight, as a factor on the set point."""
SHARED_LEGEND: Final = {"earlier": "Earlier", "invalid": "Not counted"}
"""Standings whose flights look alike and share a legend entry."""
TABLE_TIMES_S: Final = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 25.0, 30.0)


@dataclass(frozen=True, slots=True)
class TrajectoriesFigure:
    """Table columns: `time_s`, `set_point`, `reference` (if known), `envelope_lower`, `envelope_middle` and
    `envelope_upper` (with many flights), `flight_N` for each flight drawn individually, and `prediction` (if there is
    one) with `prediction_lower` and `prediction_upper` (if its band is known), at those `TABLE_TIMES_S` that lie within
    the experiment.

    Every trace carries `meta`: `role` (set point, reference, envelope, flight, legend, prediction, band, glitch, live,
    pointed, off scale) and, for flights, `trial` and `standing` (best, latest, earlier, invalid, unjudged); a flight's
    `uid` is `flight-` and its number. The traces `live` and `pointed` are empty: a page fills the first during a
    flight, the second with the flight under the pointer if that one has no curve of its own.
    """

    history: History
    theme: ThemeName = "light"
    name: ClassVar[str] = "takeoffs"

    @property
    def title(self) -> str:
        return self.history.curves_title

    def not_ready(self) -> str | None:
        return None

    def compute(self) -> Card:
        palette, history = PALETTES[self.theme], self.history
        emphasised = select_individual_flights(history, history.chosen)
        recorded = [flight for flight in history.flights if flight.curve is not None and len(flight.curve.time_s)]
        drawn = [flight for flight in recorded if flight.number in emphasised]
        envelope = envelope_of(recorded, self._lasts_s) if len(drawn) < len(recorded) else None
        points = max(60, min(CURVE_POINTS, ALL_POINTS // max(1, len(drawn))))
        band = None if history.proposal is None else history.proposal.band
        traces = [
            *envelope_traces(palette, envelope, history.output_unit),
            *band_traces(palette, band),
            self._set_point(palette),
            *self._reference(palette),
        ]
        traces += [self._flight(palette, flight, points) for flight in sorted(drawn, key=self._weight)]
        for flight in drawn:
            traces += glitch_traces(palette, flight.number, flight.curve, flight.glitches, history.output_unit)
        traces += [*self._legend(palette, drawn), *self._prediction(palette)]
        traces += [self._empty(palette, "live", "Flying now"), self._empty(palette, "pointed", "Pointed at")]
        low, high, outside = self._span(drawn)
        traces += [_off_scale(palette, drawn[index], low, high) for index in outside if index < len(drawn)]
        unit = history.output_unit
        layout = theme.layout(
            palette,
            xaxis=theme.titled(palette, "Time since the command (s)", range=self._time_range()),
            yaxis=theme.titled(palette, f"{history.output_title} ({unit})", range=[low, high], nticks=7),
            uirevision="takeoffs",
        )
        return Card(
            name=self.name,
            title=self.title,
            state="ready",
            summary=self._summary(sum(index < len(drawn) for index in outside)),
            figure=plotly_json(traces, layout),
            table=self._table(drawn, envelope),
        )

    @property
    def _lasts_s(self) -> float:
        return float(self.history.set_point.time_s[-1])

    def _time_range(self) -> list[float]:
        return [-0.01 * self._lasts_s, self._lasts_s]

    def _span(self, drawn: list[FlightData]) -> tuple[float, float, tuple[int, ...]]:
        """From the ground to above the set point; if the set point is zero, the range of the first flight."""
        curves = [flight.curve.values for flight in drawn if flight.curve is not None]
        if self.history.proposal is not None and self.history.proposal.curve is not None:
            curves.append(self.history.proposal.curve.values)
        goal = self.history.set_point.values
        low, high = min(0.0, float(goal.min())), HEADROOM * max(0.0, float(goal.max()))
        if low == high and curves:
            low, high = min(low, float(curves[0].min())), max(high, float(curves[0].max()))
        return robust_span(curves, low=low, high=high)

    def _standing(self, flight: FlightData) -> str:
        if flight.outcome == "not yet judged":
            return "unjudged"
        if flight.outcome != "valid":
            return "invalid"
        if flight is self.history.best:
            return "best"
        return "latest" if flight is self.history.latest else "earlier"

    def _weight(self, flight: FlightData) -> tuple[int, int]:
        """Drawing order: the most important flights last, on top."""
        return ("invalid", "earlier", "latest", "unjudged", "best").index(self._standing(flight)), flight.number

    def _flight(self, palette: Palette, flight: FlightData, points: int) -> dict[str, object]:
        assert flight.curve is not None
        standing = self._standing(flight)
        label = {
            "best": f"{flight.number} · best",
            "latest": f"{flight.number} · latest",
            "earlier": f"{flight.number}",
            "invalid": f"{flight.number} · {flight.outcome}",
            "unjudged": f"{flight.number} · {flight.outcome}",
        }[standing]
        error = "" if flight.error is None else f"<br>error {flight.error:.3f} {self.history.error_unit}"
        return self._trace(
            f"Flight {label}",
            flight.curve,
            points,
            uid=f"flight-{flight.number}",
            line=_style(palette, standing),
            legendrank=500 + flight.number,
            legendgroup=standing,
            showlegend=standing not in SHARED_LEGEND,
            meta={"role": "flight", "trial": flight.number, "standing": standing},
            hovertemplate=f"<b>Flight {label}</b><br>%{{x:.2f}} s · %{{y:.3f}} "
            f"{self.history.output_unit}{error}<extra></extra>",
        )

    def _legend(self, palette: Palette, drawn: list[FlightData]) -> list[dict[str, object]]:
        """One entry for all flights that look alike, so that the legend does not grow with every flight."""
        standings = {self._standing(flight) for flight in drawn}
        return [
            {
                "type": "scatter",
                "mode": "lines",
                "name": name,
                "x": [None],
                "y": [None],
                "line": _style(palette, standing),
                "meta": {"role": "legend", "standing": standing},
                "legendgroup": standing,
                "legendrank": 800,
                "hoverinfo": "skip",
            }
            for standing, name in SHARED_LEGEND.items()
            if standing in standings
        ]

    def _set_point(self, palette: Palette) -> dict[str, object]:
        style = theme.line(palette.dim, 1.5, "dot")
        return _goal("Set point", self.history.set_point, line=style, meta={"role": "set point"}, legendrank=900)

    def _reference(self, palette: Palette) -> list[dict[str, object]]:
        if self.history.reference is None:
            return []
        style = theme.line(palette.dim, 1.5, "dashdot")
        return [_goal("Reference", self.history.reference, line=style, meta={"role": "reference"}, legendrank=901)]

    def _prediction(self, palette: Palette) -> list[dict[str, object]]:
        proposal = self.history.proposal
        if proposal is None or proposal.curve is None:
            return []
        text = f"Flight {proposal.number}, predicted"
        return [
            self._trace(
                "Predicted",
                proposal.curve,
                CURVE_POINTS,
                line=theme.line(palette.prediction, 2.25, "dash"),
                meta={"role": "prediction", "trial": proposal.number},
                legendrank=899,
                hovertemplate=f"<b>{text}</b><br>%{{x:.2f}} s · %{{y:.3f}} {self.history.output_unit}<extra></extra>",
            )
        ]

    def _empty(self, palette: Palette, role: str, name: str) -> dict[str, object]:
        """An empty curve that the page fills."""
        return {
            "type": "scatter",
            "mode": "lines",
            "name": name,
            "x": [],
            "y": [],
            "showlegend": False,
            "line": theme.line(palette.ink, 3.5),
            "meta": {"role": role},
            "uid": role,
            "legendrank": 1,
            "cliponaxis": True,
            "hovertemplate": f"<b>{name}</b><br>%{{x:.2f}} s · %{{y:.3f}} {self.history.output_unit}<extra></extra>",
        }

    def _trace(self, name: str, curve: Curve, points: int, **style: object) -> dict[str, object]:
        x, y = thinned(curve.time_s, curve.values, points, self.history.window)
        return {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, **style}

    def _summary(self, outside: int) -> str:
        history = self.history
        if not history.flights:
            return f"{history.output_title} over time: no flight yet, set point and reference only."
        best = (
            ""
            if history.best is None
            else (f" Best: flight {history.best.number}, error {history.best.error:.3f} {history.error_unit}.")
        )
        off = f" {outside} off scale, marked at the top." if outside else ""
        return f"{history.output_title} over time: {count(len(history.flights), 'flight')}.{best}{off}"

    def _table(self, drawn: list[FlightData], envelope: Envelope | None) -> Table:
        history, unit = self.history, self.history.output_unit
        named: list[tuple[Column, Curve]] = [(Column("set_point", "Set point", unit, 3), history.set_point)]
        if history.reference is not None:
            named.append((Column("reference", "Reference", unit, 3), history.reference))
        if envelope is not None:
            curves = (envelope.band.lower, envelope.median, envelope.band.upper)
            named += [
                (
                    Column(f"envelope_{edge}", f"{part:.0f}\u00a0% of {envelope.flights} flights lay below", unit, 3),
                    curve,
                )
                for edge, part, curve in zip(("lower", "middle", "upper"), PERCENTILES, curves, strict=True)
            ]
        named += [
            (Column(f"flight_{flight.number}", f"Flight {flight.number}", unit, 3), flight.curve)
            for flight in drawn
            if flight.curve is not None
        ]
        if history.proposal is not None and history.proposal.curve is not None:
            title = f"Flight {history.proposal.number}, predicted"
            named.append((Column("prediction", title, unit, 3), history.proposal.curve))
            if history.proposal.band is not None:
                named.append((Column("prediction_lower", f"{title}, at least", unit, 3), history.proposal.band.lower))
                named.append((Column("prediction_upper", f"{title}, at most", unit, 3), history.proposal.band.upper))
        lasts = float(history.set_point.time_s[-1])
        times = [time_s for time_s in TABLE_TIMES_S if time_s <= lasts]
        rows = tuple((time_s, *_rounded(time_s, [curve for _, curve in named])) for time_s in times)
        return Table((Column("time_s", "Time", "s", 1), *(column for column, _ in named)), rows)


def _rounded(time_s: float, curves: list[Curve]) -> list[Cell]:
    values = [curve.at(time_s) for curve in curves]
    return [None if value is None else round(value, 4) for value in values]


def _goal(name: str, curve: Curve, **style: object) -> dict[str, object]:
    x, y = thin_by_bends(curve.time_s, curve.values)
    return {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "hoverinfo": "skip", **style}


def _style(palette: Palette, standing: str) -> dict[str, object]:
    return {
        "best": theme.line(palette.best, 3),
        "latest": theme.line(palette.ink, 2),
        "earlier": theme.line(palette.earlier, 1.25),
        "invalid": theme.line(palette.bad, 1.25, "dot"),
        "unjudged": theme.line(palette.ink, 2, "longdash"),
    }[standing]


def _off_scale(palette: Palette, flight: FlightData, low: float, high: float) -> dict[str, object]:
    """A triangle at the edge where a flight leaves the scale, labelled with its peak value."""
    assert flight.curve is not None
    values = flight.curve.values
    up = bool(values.max() - high >= low - values.min())
    peak = int(values.argmax() if up else values.argmin())
    text = f"Flight {flight.number} reaches {values[peak]:.2f}"
    return {
        "type": "scatter",
        "mode": "markers+text",
        "name": text,
        "x": [round(float(flight.curve.time_s[peak]), 3)],
        "y": [high if up else low],
        "text": [f"{flight.number} {'↑' if up else '↓'} {values[peak]:.1f}"],
        "textposition": "bottom center" if up else "top center",
        "marker": {"symbol": "triangle-up" if up else "triangle-down", "size": 12, "color": palette.bad},
        "textfont": {"color": palette.bad},
        "showlegend": False,
        "cliponaxis": False,
        "meta": {"role": "off scale", "trial": flight.number},
        "hovertemplate": f"{text}<extra></extra>",
    }
