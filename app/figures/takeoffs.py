"""All flights over set point and reference trajectory: the best emphasised, the next one's prediction dashed."""

from dataclasses import dataclass
from typing import ClassVar, Final

from app.figures import theme
from app.figures.base import Card, Cell, Column, Table, plotly_json
from app.figures.history import Curve, FlightData, History
from app.figures.scale import robust_range, thinned
from app.figures.theme import PALETTES, Palette, ThemeName

CURVE_POINTS: Final = 500
ALL_POINTS: Final = 12_000
HEADROOM: Final = 1.15
"""Room above the set point, as a multiple of it, for the flight that is still to come."""
ALIKE: Final = {"earlier": "Earlier", "invalid": "Not counted"}
"""Standings whose flights look alike and share an entry of the legend."""
TABLE_TIMES_S: Final = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 25.0, 30.0)


@dataclass(frozen=True, slots=True)
class TakeoffsFigure:
    """Table columns: `time_s`, `set_point`, `reference` (where known), `flight_N` for each flight with a record, and
    `prediction` (where there is one), at the seconds of `TABLE_TIMES_S`.

    Every trace carries `meta`: `role` (set point, reference, flight, legend, prediction, live, off scale) and, for
    flights, `trial` and `standing` (best, latest, earlier, invalid). The `live` trace is empty: a page fills it while
    it flies.
    """

    history: History
    theme: ThemeName = "light"
    name: ClassVar[str] = "takeoffs"
    title: ClassVar[str] = "Takeoff curves"

    def not_ready(self) -> str | None:
        return None

    def compute(self) -> Card:
        palette, history = PALETTES[self.theme], self.history
        drawn = [flight for flight in history.flights if flight.curve is not None]
        points = max(60, min(CURVE_POINTS, ALL_POINTS // max(1, len(drawn))))
        traces = [self._set_point(palette), *self._reference(palette)]
        traces += [self._flight(palette, flight, points) for flight in sorted(drawn, key=self._weight)]
        traces += [*self._legend(palette, drawn), *self._prediction(palette), self._live(palette)]
        peaks = [float(flight.curve.values.max()) for flight in drawn if flight.curve is not None]
        predicted = [] if history.proposal is None or history.proposal.curve is None else [history.proposal.curve]
        span = robust_range(
            [*peaks, *(float(curve.values.max()) for curve in predicted)],
            low=0.0,
            high=HEADROOM * float(history.set_point.values.max()),
        )
        traces += [_off_scale(palette, drawn[index], span.high) for index in span.outside if index < len(drawn)]
        unit = history.output_unit
        layout = theme.layout(
            palette,
            xaxis=theme.titled(palette, "Time since the command (s)", range=self._time_range()),
            yaxis=theme.titled(palette, f"{history.output_title} ({unit})", range=[span.low, span.high], nticks=7),
            uirevision="takeoffs",
        )
        return Card(
            name=self.name,
            title=self.title,
            state="ready",
            summary=self._summary(sum(index < len(drawn) for index in span.outside)),
            figure=plotly_json(traces, layout),
            table=self._table(drawn),
        )

    def _time_range(self) -> list[float]:
        return [-0.3, float(self.history.set_point.time_s[-1])]

    def _standing(self, flight: FlightData) -> str:
        if flight.outcome != "valid":
            return "invalid"
        if flight is self.history.best:
            return "best"
        return "latest" if flight is self.history.latest else "earlier"

    def _weight(self, flight: FlightData) -> tuple[int, int]:
        """Drawing order: what matters most comes last, on top."""
        return ("invalid", "earlier", "latest", "best").index(self._standing(flight)), flight.number

    def _flight(self, palette: Palette, flight: FlightData, points: int) -> dict[str, object]:
        assert flight.curve is not None
        standing = self._standing(flight)
        label = {
            "best": f"{flight.number} · best",
            "latest": f"{flight.number} · latest",
            "earlier": f"{flight.number}",
            "invalid": f"{flight.number} · {flight.outcome}",
        }[standing]
        error = "" if flight.error is None else f"<br>error {flight.error:.3f} {self.history.error_unit}"
        return _trace(
            f"Flight {label}",
            flight.curve,
            points,
            line=_style(palette, standing),
            legendrank=500 + flight.number,
            legendgroup=standing,
            showlegend=standing in {"best", "latest"},
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
            for standing, name in ALIKE.items()
            if standing in standings
        ]

    def _set_point(self, palette: Palette) -> dict[str, object]:
        return _trace(
            "Set point",
            self.history.set_point,
            CURVE_POINTS,
            line=theme.line(palette.dim, 1.5, "dot"),
            meta={"role": "set point"},
            hoverinfo="skip",
            legendrank=900,
        )

    def _reference(self, palette: Palette) -> list[dict[str, object]]:
        if self.history.reference is None:
            return []
        return [
            _trace(
                "Reference",
                self.history.reference,
                CURVE_POINTS,
                line=theme.line(palette.dim, 1.5, "dashdot"),
                meta={"role": "reference"},
                hoverinfo="skip",
                legendrank=901,
            )
        ]

    def _prediction(self, palette: Palette) -> list[dict[str, object]]:
        proposal = self.history.proposal
        if proposal is None or proposal.curve is None:
            return []
        text = f"Flight {proposal.number}, predicted"
        return [
            _trace(
                "Predicted",
                proposal.curve,
                CURVE_POINTS,
                line=theme.line(palette.prediction, 2.25, "dash"),
                meta={"role": "prediction", "trial": proposal.number},
                legendrank=899,
                hovertemplate=f"<b>{text}</b><br>%{{x:.2f}} s · %{{y:.3f}} {self.history.output_unit}<extra></extra>",
            )
        ]

    def _live(self, palette: Palette) -> dict[str, object]:
        return {
            "type": "scatter",
            "mode": "lines",
            "name": "Flying now",
            "x": [],
            "y": [],
            "showlegend": False,
            "line": theme.line(palette.ink, 3.5),
            "meta": {"role": "live"},
            "legendrank": 1,
            "cliponaxis": True,
            "hovertemplate": f"<b>Flying now</b><br>%{{x:.2f}} s · %{{y:.3f}} {self.history.output_unit}"
            "<extra></extra>",
        }

    def _summary(self, outside: int) -> str:
        history = self.history
        if not history.flights:
            return f"{history.output_title} over time: no flight yet, set point and reference only."
        best = (
            ""
            if history.best is None
            else (f" Best: flight {history.best.number}, error {history.best.error:.3f} {history.error_unit}.")
        )
        off = f" {outside} off the scale, marked at the top." if outside else ""
        noun = "flight" if len(history.flights) == 1 else "flights"
        return f"{history.output_title} over time: {len(history.flights)} {noun}.{best}{off}"

    def _table(self, drawn: list[FlightData]) -> Table:
        history, unit = self.history, self.history.output_unit
        named: list[tuple[Column, Curve]] = [(Column("set_point", "Set point", unit, 3), history.set_point)]
        if history.reference is not None:
            named.append((Column("reference", "Reference", unit, 3), history.reference))
        named += [
            (Column(f"flight_{flight.number}", f"Flight {flight.number}", unit, 3), flight.curve)
            for flight in drawn
            if flight.curve is not None
        ]
        if history.proposal is not None and history.proposal.curve is not None:
            named.append(
                (Column("prediction", f"Flight {history.proposal.number}, predicted", unit, 3), history.proposal.curve)
            )
        rows = tuple((time_s, *_rounded(time_s, [curve for _, curve in named])) for time_s in TABLE_TIMES_S)
        return Table((Column("time_s", "Time", "s", 1), *(column for column, _ in named)), rows)


def _rounded(time_s: float, curves: list[Curve]) -> list[Cell]:
    values = [curve.at(time_s) for curve in curves]
    return [None if value is None else round(value, 4) for value in values]


def _style(palette: Palette, standing: str) -> dict[str, object]:
    return {
        "best": theme.line(palette.best, 3),
        "latest": theme.line(palette.ink, 2),
        "earlier": theme.line(palette.earlier, 1.25),
        "invalid": theme.line(palette.bad, 1.25, "dot"),
    }[standing]


def _trace(name: str, curve: Curve, points: int, **style: object) -> dict[str, object]:
    x, y = thinned(curve.time_s, curve.values, points)
    return {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, **style}


def _off_scale(palette: Palette, flight: FlightData, top: float) -> dict[str, object]:
    """A triangle at the upper edge where a flight leaves the scale, with how far it went."""
    assert flight.curve is not None
    peak = int(flight.curve.values.argmax())
    text = f"Flight {flight.number} reaches {flight.curve.values[peak]:.2f}"
    return {
        "type": "scatter",
        "mode": "markers+text",
        "name": text,
        "x": [round(float(flight.curve.time_s[peak]), 3)],
        "y": [top],
        "text": [f"{flight.number} ↑ {flight.curve.values[peak]:.1f}"],
        "textposition": "bottom center",
        "marker": {"symbol": "triangle-up", "size": 12, "color": palette.bad},
        "textfont": {"color": palette.bad},
        "showlegend": False,
        "cliponaxis": False,
        "meta": {"role": "off scale", "trial": flight.number},
        "hovertemplate": f"{text}<extra></extra>",
    }
