"""The error of each flight: measured, predicted, best so far, and the threshold for the next one."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from app.core import formatting
from app.figures import theme
from app.figures.base import Card, Cell, Column, Table, Trace, ready, scatter
from app.figures.data import AnyFlight, FlightData, History, Range
from app.figures.overlays import MANY, off_scale_traces
from app.figures.scale import RobustRange, robust_range

FEW: Final = 8
"""Up to this number of flights, every error is labelled."""
STRIP: Final = 0.1
"""Height of the strip below the axis of errors, for flights without one, as a share of the figure."""
_STRIP_GAP: Final = 0.07


@dataclass(frozen=True, slots=True)
class ErrorsFigure:
    """Table columns: `flight`, `outcome`, `error`, `standard_error` (of one flight, if the noise is known),
    `predicted_error`, `predicted_low`, `predicted_high`, `best_so_far`; the proposal is the last row.

    Every trace carries `meta.role`: noise (around the best), best so far, threshold, interval, predicted, repeats,
    measured, not counted, not yet reviewed, off scale. In `interval` and `predicted` the next flight is the last one,
    and `meta.next` is its number: a page puts other gains in its place. Both are hidden while they are empty. Flights
    without an error are marked in a strip below the axis of errors.
    """

    history: History
    theme_name: theme.ThemeName = "light"
    name: ClassVar[str] = "errors"
    title: ClassVar[str] = "Error per flight"

    @property
    def _reading(self) -> str:
        return f"%{{y:.4f}} {self.history.error_unit}"

    def not_ready(self) -> str | None:
        if any(flight.error is not None for flight in self.history.flights):
            return None
        return "The error of each flight appears here after the first valid flight."

    def compute(self) -> Card:
        palette, history = theme.PALETTES[self.theme_name], self.history
        last, span, strip = history.last_number, self._span(), self._strip(palette)
        traces = [
            *self._noise(palette, last),
            self._best_so_far(palette),
            *self._threshold(palette, last),
            *self._intervals(palette, span.high),
            *self._predicted(palette, 1.08 * span.high),
            *self._repeats(palette),
            *self._measured(palette),
            *self._not_valid(palette),
        ]
        scored = [flight for flight in history.flights if flight.error is not None]
        outside = [scored[index] for index in span.outside]
        traces += off_scale_traces(palette, outside, span.high, history.error_unit, last=last, crowded=self._is_crowded)
        layout = theme.layout(
            palette,
            xaxis=theme.axis(
                palette,
                "Flight",
                anchor="y2" if strip else "y",
                **theme.flight_ticks(last) | {"range": [0.5, last + 0.95]},
            ),
            yaxis=theme.axis(
                palette,
                f"Error ({history.error_unit})",
                domain=[STRIP + _STRIP_GAP if strip else 0.0, 1.0],
                range=[0, 1.08 * span.high],
                nticks=6,
            ),
            **strip,
            margin={**theme.MARGIN_PX, "l": 60, "r": 30},
            annotations=self._labels(palette, span.high),
            uirevision="errors",
        )
        return ready(self, traces, layout, summary=self._summary(), table=self._table())

    def _strip(self, palette: theme.Palette) -> dict[str, object]:
        """The ordinate of the strip below the errors; empty if every flight has an error."""
        if all(flight.error is not None for flight in self.history.flights):
            return {}
        strip = theme.axis(
            palette,
            domain=[0.0, STRIP],
            range=[-1, 1],
            tickvals=[0],
            ticktext=["no error"],
            fixedrange=True,
            automargin=False,
        )
        return {"yaxis2": strip}

    def _span(self) -> RobustRange:
        """Range up to the first flight's error, every other one that is no outlier, and what was or is predicted."""
        errors = [flight.error for flight in self.history.flights if flight.error is not None]
        first = [flight.error for flight in self.history.valid[:1] if flight.error is not None]
        expected = [interval.high for _, interval in self._expected()]
        expected += [value for _, value in self._predictions()]
        high = max(first, default=min(errors))
        return robust_range(errors, low=0.0, high=max([high, *(value for value in expected if value < 2.0 * high)]))

    def _measured(self, palette: theme.Palette) -> Iterator[Trace]:
        flights, best = self.history.valid, self.history.best
        if not flights:
            return
        colours = [palette.best if flight is best else palette.ink for flight in flights]
        size = 4 if self._is_crowded else 8
        yield scatter(
            "Measured",
            ([flight.number for flight in flights], [_rounded(flight.error) for flight in flights]),
            role="measured",
            mode="markers",
            cliponaxis=False,
            **self._error_bars(palette),
            marker=theme.solid(
                colours,
                size=[13 if flight is best else size for flight in flights],
                symbol=["star" if flight is best else "circle" for flight in flights],
            ),
            hovertemplate=f"<b>Flight %{{x}}</b><br>error {self._reading}{self._scatter}<extra></extra>",
        )

    @property
    def _is_crowded(self) -> bool:
        return len(self.history.flights) > MANY

    @property
    def _scatter(self) -> str:
        noise = self.history.noise
        return "" if noise is None else f" ± {noise.sd:.4f} (scatter of one flight)"

    def _error_bars(self, palette: theme.Palette) -> dict[str, Any]:
        """One standard deviation of a single flight, up and down."""
        noise = self.history.noise
        if noise is None or self._is_crowded:
            return {}
        bar = {"type": "constant", "value": round(noise.sd, 6), "color": palette.ink, "thickness": 1.5, "width": 5}
        return {"error_y": bar}

    def _noise(self, palette: theme.Palette, last: int) -> Iterator[Trace]:
        """Range in which another flight of the best gains would lie: a result inside it is not significant."""
        noise = self.history.noise
        if noise is None or noise.around_best is None:
            return
        low, high = round(max(0.0, noise.around_best.low), 6), round(noise.around_best.high, 6)
        right = last + 0.95
        yield scatter(
            "Scatter of best" if noise.repeats else "Scatter (prior)",
            ([0.5, right, right, 0.5, 0.5], [low, low, high, high, low]),
            role="noise",
            line=theme.line(theme.with_opacity(palette.best, 0.3), 0.75),
            fill="toself",
            fillcolor=theme.with_opacity(palette.best, 0.12),
        )

    def _repeats(self, palette: theme.Palette) -> Iterator[Trace]:
        """Mean of flights with the same gains, with its standard error, beside the last of them."""
        repeats = () if self.history.noise is None else self.history.noise.repeats
        if not repeats:
            return
        unit = self.history.error_unit
        yield scatter(
            "Mean of repeats",
            ([max(group.numbers) + 0.22 for group in repeats], [round(group.mean, 6) for group in repeats]),
            role="repeats",
            mode="markers",
            text=[
                f"{formatting.named_flights(group.numbers).capitalize()}<br>"
                f"mean {group.mean:.4f} ± {group.standard_error:.4f} {unit} (standard error)"
                for group in repeats
            ],
            error_y={
                "type": "data",
                "array": [round(group.standard_error, 6) for group in repeats],
                "color": palette.best,
                "thickness": 3,
                "width": 0,
            },
            marker=theme.solid(palette.best, size=9, symbol="square"),
            cliponaxis=False,
            hovertemplate="<b>%{text}</b><extra></extra>",
        )

    def _intervals(self, palette: theme.Palette, top: float) -> Iterator[Trace]:
        """Predicted interval of each flight's error, or only the next one's if there are many.

        A bar behind the diamond of the prediction, cut at the edge.
        """
        known = self._expected()
        if not known and self.history.proposal is None:
            return
        x, y, text = [], [], []
        for number, interval in known:
            x += [number, number, None]
            y += [round(max(0.0, interval.low), 6), round(min(1.08 * top, interval.high), 6), None]
            text += 3 * [f"{interval.low:.4f} … {interval.high:.4f}"]
        yield scatter(
            "90 % interval",
            (x, y),
            role="interval",
            about=self._next,
            visible=bool(known),
            text=text,
            line=theme.line(theme.with_opacity(palette.prediction, 0.4), 8),
            connectgaps=False,
            hovertemplate=f"<b>Flight %{{x}}</b><br>predicted %{{text}} {self.history.error_unit}<extra></extra>",
        )

    @property
    def _next(self) -> dict[str, object]:
        return {} if self.history.proposal is None else {"next": self.history.proposal.number}

    def _predicted_flights(self) -> list[AnyFlight]:
        """The flights whose predictions are drawn."""
        flown = () if self._is_crowded else self.history.flights
        return [*flown, *([] if self.history.proposal is None else [self.history.proposal])]

    def _expected(self) -> list[tuple[int, Range]]:
        return [(each.number, each.interval) for each in self._predicted_flights() if each.interval is not None]

    def _labels(self, palette: theme.Palette, top: float) -> list[dict[str, object]]:
        """The error beside each mark, clear of the steps; with many flights only the best."""
        flights, best = self.history.valid, self.history.best
        return [
            theme.label(
                formatting.short(flight.error),
                palette.best if flight is best else palette.ink,
                x=flight.number,
                y=flight.error,
                xshift=6,
                yshift=13,
                **({"bgcolor": palette.surface, "borderpad": 1} if self._is_crowded else {}),
            )
            for flight in flights
            if flight.error is not None and flight.error <= top and (flight is best or len(flights) <= FEW)
        ]

    def _not_valid(self, palette: theme.Palette) -> list[Trace]:
        """Marks for flights that do not count and those without a review: at their error, or in the strip."""
        flights = self.history.flights
        uncounted = [flight for flight in flights if flight.outcome not in {"valid", "not yet reviewed"}]
        unjudged = [flight for flight in flights if flight.outcome == "not yet reviewed"]
        marked = (
            ("not counted", uncounted, "x-thin", palette.bad),
            ("not yet reviewed", unjudged, "circle-open", palette.dim),
        )
        return [
            trace
            for role, marks, symbol, colour in marked
            for trace in self._marks(role, marks, {"symbol": symbol, "color": colour, "line": {"color": colour}})
        ]

    def _marks(self, role: str, flights: list[FlightData], style: dict[str, Any]) -> list[Trace]:
        scored = [flight for flight in flights if flight.error is not None]
        others = [flight for flight in flights if flight.error is None]
        places = (
            ("y", scored, [_rounded(flight.error) for flight in scored], f"error {self._reading}"),
            ("y2", others, [0] * len(others), "no error"),
        )
        return [
            scatter(
                role.capitalize(),
                ([flight.number for flight in placed], heights),
                role=role,
                mode="markers",
                text=[flight.outcome for flight in placed],
                marker={**style, "size": 10, "line": {**style["line"], "width": 2}},
                cliponaxis=False,
                yaxis=axis,
                legendgroup=role,
                showlegend=placed is scored or not scored,
                hovertemplate=f"<b>Flight %{{x}}, %{{text}}</b><br>{note}<extra></extra>",
            )
            for axis, placed, heights, note in places
            if placed
        ]

    def _best_so_far(self, palette: theme.Palette) -> Trace:
        best = best_so_far(self.history)
        numbers = [flight.number for flight in self.history.valid]
        return scatter(
            "Best so far",
            (numbers, [round(value, 6) for value in best]),
            role="best so far",
            line={**theme.line(palette.best, 2), "shape": "hv"},
        )

    def _threshold(self, palette: theme.Palette, last: int) -> Iterator[Trace]:
        """The error below which the stop rule counts a further flight as an improvement."""
        best, improvement = self.history.best, self.history.stop_improvement
        if best is None or best.error is None or improvement is None:
            return
        value = round(best.error * (1 - improvement), 6)
        yield scatter(
            f"To beat: {formatting.short(value)}",
            ([0.5, last + 0.95], [value, value]),
            role="threshold",
            line=theme.line(palette.dim, 1.25, "dot"),
        )

    def _predicted(self, palette: theme.Palette, top: float) -> Iterator[Trace]:
        """The predicted error of each flight, or only the next one's if there are many: a diamond, or where it is off
        the scale, a triangle at the edge."""
        known = self._predictions()
        if not known and self.history.proposal is None:
            return
        yield scatter(
            "Predicted",
            ([number for number, _ in known], [min(value, round(top, 6)) for _, value in known]),
            role="predicted",
            about=self._next,
            visible=bool(known),
            mode="markers",
            text=[f"{value:.4f}" for _, value in known],
            marker={
                "size": 13,
                "symbol": ["triangle-up-open" if value > top else "diamond-open" for _, value in known],
                "color": palette.prediction,
                "line": {"width": 1.75},
            },
            cliponaxis=False,
            hovertemplate=f"<b>Flight %{{x}}, predicted</b><br>%{{text}} {self.history.error_unit}<extra></extra>",
        )

    def _predictions(self) -> list[tuple[int, float]]:
        """Predicted errors by the number of their flight."""
        pairs = [(each.number, each.predicted_error) for each in self._predicted_flights()]
        return [(number, round(value, 6)) for number, value in pairs if value is not None]

    def _summary(self) -> str:
        best, valid = self.history.best, self.history.valid
        if best is None or best.error is None:
            return "No valid flight yet."
        first = valid[0].error
        assert first is not None
        share = "" if best is valid[0] else f", {100 * (1 - best.error / first):.0f} % below flight {valid[0].number}"
        return f"Best error {formatting.short(best.error)} {self.history.error_unit} in flight {best.number}{share}."

    def _table(self) -> Table:
        unit, noise, proposal = self.history.error_unit, self.history.noise, self.history.proposal
        running = dict(zip((flight.number for flight in self.history.valid), best_so_far(self.history), strict=True))
        rows: list[tuple[Cell, ...]] = [
            (
                flight.number,
                flight.outcome,
                flight.error,
                None if noise is None or flight.error is None else round(noise.sd, 6),
                flight.predicted_error,
                *_ends(flight.interval),
                running.get(flight.number),
            )
            for flight in self.history.flights
        ]
        if proposal is not None and proposal.predicted_error is not None:
            rows.append(
                (proposal.number, "proposed", None, None, proposal.predicted_error, *_ends(proposal.interval), None)
            )
        return Table(
            (
                Column("flight", "Flight", digits=0),
                Column("outcome", "Outcome"),
                Column("error", "Error", unit, 4),
                Column("standard_error", "± scatter of one flight", unit, 4),
                Column("predicted_error", "Predicted", unit, 4),
                Column("predicted_low", "90 % interval, lower", unit, 4),
                Column("predicted_high", "90 % interval, upper", unit, 4),
                Column("best_so_far", "Best so far", unit, 4),
            ),
            tuple(rows),
        )


def best_so_far(history: History) -> list[float]:
    """Running minimum of the error, one value per valid flight."""
    running: list[float] = []
    for flight in history.valid:
        assert flight.error is not None
        running.append(min([flight.error, *running[-1:]]))
    return running


def _ends(interval: Range | None) -> tuple[float | None, float | None]:
    return (None, None) if interval is None else (interval.low, interval.high)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 6)
