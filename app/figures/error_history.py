"""The error of each flight: measured, predicted, best so far, and the threshold for the next one."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, Final

from app.core import formatting
from app.core.definition import Interval
from app.figures import theme
from app.figures.base import CampaignFigure, Card, Cell, Column, Table, Trace, scatter
from app.figures.data import AnyFlight, FlightData, robust_top
from app.figures.overlays import MANY, triangle

FEW: Final = 8
"""Up to this number of flights, every error is labelled."""
STRIP: Final = 0.1
"""Height of the strip below the axis of errors, for flights without one, as a share of the figure."""
_STRIP_GAP: Final = 0.07
PRINT: Final = 0.18
"""Width of a printed error on a phone, as a share of the axis."""


@dataclass(frozen=True, slots=True)
class ErrorsFigure(CampaignFigure):
    """Table columns: `flight`, `outcome`, `error`, `standard_error` (of one flight, if the noise is known),
    `predicted_error`, `predicted_low`, `predicted_high`, `best_so_far`; the proposal is the last row.

    Every trace carries `meta.role`: noise (around the best), best so far, threshold, interval, predicted, repeats,
    measured, not counted, not yet reviewed, off scale. In `interval` and `predicted` the next flight is the last one,
    and `meta.next` is its number: a page puts other gains in its place. Both are hidden while they are empty. Flights
    without an error are marked in a strip below the axis of errors.
    """

    name = "errors"
    title = "Error per flight"

    @property
    def _reading(self) -> str:
        return f"%{{y:.4f}} {self.history.error_unit}"

    def not_ready(self) -> str | None:
        if any(flight.error is not None for flight in self.history.flights):
            return None
        return "The error of each flight appears here after the first valid flight."

    def compute(self) -> Card:
        history = self.history
        scored = [flight for flight in history.flights if flight.error is not None]
        top, outside = self._top()
        strip = self._strip()
        traces = [
            *self._noise(),
            self._best_so_far(),
            *self._threshold(),
            *self._intervals(top),
            *self._predicted(1.08 * top),
            *self._repeats(),
            *self._measured(),
            *self._not_valid(),
            *self._off_scale([scored[index] for index in outside], top),
        ]
        return self.ready(
            traces,
            summary=self._summary(),
            table=self._table(),
            xaxis=self.palette.axis(
                "Flight",
                anchor="y2" if strip else "y",
                **theme.flight_ticks(history.last_number) | {"range": [0.5, self._right]},
            ),
            yaxis=self.palette.axis(
                f"Error ({history.error_unit})",
                domain=[STRIP + _STRIP_GAP if strip else 0.0, 1.0],
                range=[0, 1.08 * top],
                nticks=6,
            ),
            **strip,
            margin={**theme.MARGIN_PX, "l": 60, "r": 30},
            annotations=self._labels(top),
        )

    def _strip(self) -> dict[str, object]:
        """The ordinate of the strip below the errors; empty if every flight has an error."""
        if all(flight.error is not None for flight in self.history.flights):
            return {}
        return {
            "yaxis2": self.palette.axis(
                domain=[0.0, STRIP],
                range=[-1, 1],
                tickvals=[0],
                ticktext=["no error"],
                fixedrange=True,
                automargin=False,
            )
        }

    @property
    def _right(self) -> float:
        """Right end of the axis of flights."""
        return self.history.last_number + 0.95

    def _top(self) -> tuple[float, list[int]]:
        """Range up to the first flight's error, every other one that is no outlier, and what was or is predicted; and
        the indices of the outliers."""
        errors = [flight.error for flight in self.history.flights if flight.error is not None]
        expected = [interval.upper for _, interval in self._expected()]
        expected += [value for _, value in self._predictions()]
        high = max(self.history.valid_errors[:1], default=min(errors))
        return robust_top(errors, low=0.0, high=max([high, *(value for value in expected if value < 2.0 * high)]))

    def _measured(self) -> Iterator[Trace]:
        flights, best, noise = self.history.valid, self.history.best, self.history.noise
        if not flights:
            return
        size = 4 if self._is_crowded else 8
        spread = "" if noise is None else f" ± {noise.sd:.4f} (scatter of one flight)"
        bars: dict[str, Any] = {}
        if noise is not None and not self._is_crowded:
            bars["error_y"] = theme.bars(self.palette.ink, 1.5, 5, type="constant", value=round(noise.sd, 6))
        yield scatter(
            "Measured",
            ([flight.number for flight in flights], [round(error, 6) for error in self.history.valid_errors]),
            role="measured",
            mode="markers",
            cliponaxis=False,
            **bars,
            marker=theme.solid(
                [self.palette.best if flight is best else self.palette.ink for flight in flights],
                size=[13 if flight is best else size for flight in flights],
                symbol=["star" if flight is best else "circle" for flight in flights],
            ),
            hovertemplate=f"<b>Flight %{{x}}</b><br>error {self._reading}{spread}<extra></extra>",
        )

    @property
    def _is_crowded(self) -> bool:
        return len(self.history.flights) > MANY

    def _noise(self) -> Iterator[Trace]:
        """Range in which another flight of the best gains would lie: a result inside it is not significant."""
        noise = self.history.noise
        if noise is None or noise.around_best is None:
            return
        low, high = round(max(0.0, noise.around_best.low), 6), round(noise.around_best.high, 6)
        yield scatter(
            "Scatter of best" if noise.repeats else "Scatter (prior)",
            ([0.5, self._right, self._right, 0.5, 0.5], [low, low, high, high, low]),
            role="noise",
            line=theme.line(theme.with_opacity(self.palette.best, 0.3), 0.75),
            fill="toself",
            fillcolor=theme.with_opacity(self.palette.best, 0.12),
        )

    def _repeats(self) -> Iterator[Trace]:
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
            error_y=theme.bars(
                self.palette.best, 3, 0, type="data", array=[round(group.standard_error, 6) for group in repeats]
            ),
            marker=theme.solid(self.palette.best, size=9, symbol="square"),
            cliponaxis=False,
            hovertemplate="<b>%{text}</b><extra></extra>",
        )

    def _intervals(self, top: float) -> Iterator[Trace]:
        """Predicted interval of each flight's error, or only the next one's if there are many.

        A bar behind the diamond of the prediction, cut at the edge.
        """
        known = self._expected()
        if not known and self.history.proposal is None:
            return
        x, y, text = [], [], []
        for number, interval in known:
            x += [number, number, None]
            y += [round(max(0.0, interval.lower), 6), round(min(1.08 * top, interval.upper), 6), None]
            text += 3 * [f"{interval.lower:.4f} … {interval.upper:.4f}"]
        yield scatter(
            "90 % interval",
            (x, y),
            role="interval",
            about=self._next,
            visible=bool(known),
            text=text,
            line=theme.line(theme.with_opacity(self.palette.prediction, 0.4), 8),
            connectgaps=False,
            hovertemplate=f"<b>Flight %{{x}}</b><br>predicted %{{text}} {self.history.error_unit}<extra></extra>",
        )

    @property
    def _next(self) -> dict[str, object]:
        return {} if self.history.proposal is None else {"next": self.history.proposal.number}

    def _predicted_flights(self) -> list[AnyFlight]:
        """The flights whose predictions are drawn."""
        return [*(() if self._is_crowded else self.history.flights), *self.history.next_flights]

    def _expected(self) -> list[tuple[int, Interval]]:
        return [(each.number, each.interval) for each in self._predicted_flights() if each.interval is not None]

    def _labels(self, top: float) -> list[dict[str, object]]:
        """The error beside each mark, clear of the steps; with many flights only the best."""
        flights, best = self.history.valid, self.history.best
        return [
            theme.label(
                formatting.short(flight.error),
                self.palette.best if flight is best else self.palette.ink,
                x=flight.number,
                y=flight.error,
                xshift=6,
                yshift=13,
                **({"bgcolor": self.palette.surface, "borderpad": 1} if self._is_crowded else {}),
            )
            for flight in flights
            if flight.error is not None and flight.error <= top and (flight is best or len(flights) <= FEW)
        ]

    def _not_valid(self) -> Iterator[Trace]:
        """Marks for flights that do not count and those without a review: at their error, or in the strip."""
        flights = self.history.flights
        uncounted = [flight for flight in flights if flight.outcome not in {"valid", "not yet reviewed"}]
        unjudged = [flight for flight in flights if flight.outcome == "not yet reviewed"]
        for role, marked, symbol, colour in (
            ("not counted", uncounted, "x-thin", self.palette.bad),
            ("not yet reviewed", unjudged, "circle-open", self.palette.dim),
        ):
            scored = [flight for flight in marked if flight.error is not None]
            others = [flight for flight in marked if flight.error is None]
            errors = [round(flight.error, 6) for flight in scored if flight.error is not None]
            for axis, placed, heights, note in (
                ("y", scored, errors, f"error {self._reading}"),
                ("y2", others, [0] * len(others), "no error"),
            ):
                if placed:
                    yield scatter(
                        role.capitalize(),
                        ([flight.number for flight in placed], heights),
                        role=role,
                        mode="markers",
                        text=[flight.outcome for flight in placed],
                        marker={"symbol": symbol, "color": colour, "line": {"color": colour, "width": 2}, "size": 10},
                        cliponaxis=False,
                        yaxis=axis,
                        legendgroup=role,
                        showlegend=placed is scored or not scored,
                        hovertemplate=f"<b>Flight %{{x}}, %{{text}}</b><br>{note}<extra></extra>",
                    )

    def _off_scale(self, flights: list[FlightData], top: float) -> Iterator[Trace]:
        """Marks at the edge `top` for errors above it: of many flights in one trace, of few one each, and with the
        errors that have room."""
        if flights and self._is_crowded:
            yield scatter(
                "Off scale",
                ([flight.number for flight in flights], [top] * len(flights)),
                role="off scale",
                mode="markers",
                text=[f"{flight.error:.2f} {self.history.error_unit}" for flight in flights],
                marker={"symbol": "triangle-up", "size": 8, "color": self.palette.bad},
                cliponaxis=False,
                hovertemplate="<b>Flight %{x}</b><br>error %{text}<extra></extra>",
            )
            return
        free = 0.0
        for flight in flights:
            has_room = flight.number >= free
            yield triangle(
                f"Flight {flight.number}: {flight.error:.2f} {self.history.error_unit}",
                (flight.number, top),
                self.palette.bad,
                trial=flight.number,
                label=f"↑ {flight.error:.2f}" if has_room else "",
            )
            if has_room:
                free = flight.number + PRINT * self.history.last_number

    def _best_so_far(self) -> Trace:
        numbers = [flight.number for flight in self.history.valid]
        return scatter(
            "Best so far",
            (numbers, [round(value, 6) for value in accumulate(self.history.valid_errors, min)]),
            role="best so far",
            line={**theme.line(self.palette.best, 2), "shape": "hv"},
        )

    def _threshold(self) -> Iterator[Trace]:
        """The error below which the stop rule counts a further flight as an improvement."""
        errors, improvement = self.history.valid_errors, self.history.stop_improvement
        if not errors or improvement is None:
            return
        value = round(min(errors) * (1 - improvement), 6)
        yield scatter(
            f"To beat: {formatting.short(value)}",
            ([0.5, self._right], [value, value]),
            role="threshold",
            line=theme.line(self.palette.dim, 1.25, "dot"),
        )

    def _predicted(self, top: float) -> Iterator[Trace]:
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
                "color": self.palette.prediction,
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
        best, errors = self.history.best, self.history.valid_errors
        if best is None:
            return "No valid flight yet."
        first = self.history.valid[0]
        lowest = min(errors)
        has_share = best is not first and errors[0] > formatting.NEGLIGIBLE
        share = f", {100 * (1 - lowest / errors[0]):.0f} % below flight {first.number}" if has_share else ""
        return f"Best error {formatting.short(lowest)} {self.history.error_unit} in flight {best.number}{share}."

    def _table(self) -> Table:
        unit, noise, proposal = self.history.error_unit, self.history.noise, self.history.proposal
        best_so_far = accumulate(self.history.valid_errors, min)
        running = dict(zip((flight.number for flight in self.history.valid), best_so_far, strict=True))
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


def _ends(interval: Interval | None) -> tuple[float | None, float | None]:
    return (None, None) if interval is None else (interval.lower, interval.upper)
