"""All flights over set point and reference trajectory, and their deviation from what they are scored against below: the
best emphasised, the next one's prediction dashed.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any, Final, cast

from app.core.formatting import count, short
from app.figures import theme
from app.figures.base import CampaignFigure, Card, NamedCurve, Table, Trace, reading, scatter, table_of_curves
from app.figures.data import Curve, FlightData, Range, RobustSpan, span_around, thin_by_bends, thinned
from app.figures.deviations import (
    changes_of,
    deviation_axis,
    deviation_limit,
    deviation_of,
    is_step,
    off_scale_deviations,
)
from app.figures.overlays import (
    PERCENTILES,
    Envelope,
    band_traces,
    envelope_of,
    envelope_traces,
    glitch_traces,
    off_scale,
    part_off_scale,
    select_individual_flights,
)

SHARED_LEGEND: Final = {"earlier": "Earlier", "invalid": "Not counted"}
"""Standings whose flights look alike and share a legend entry."""
_ORDER: Final = ("invalid", "earlier", "baseline", "latest", "unjudged", "best")
"""The most important flights last, on top."""
CURVE_POINTS: Final = 500
ALL_POINTS: Final = 12_000
HEADROOM: Final = 1.15
"""Room above the set point for the next flight, as a factor on the set point."""
OPENING_S: Final = (-0.3, 8.0)
"""Time range at first: the climb and the overshoot; with later set points from the first of these to the end."""
_BEFORE_S: Final = 1.0
DEVIATION_SHARE: Final = 0.3
"""Height of the lower panel, as a share of the figure."""
_PANEL_GAP: Final = 0.07
_DEVIATION_POINTS: Final = 160
TABLE_TIMES_S: Final = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 25.0, 30.0)


@dataclass(frozen=True, slots=True)
class TrajectoriesFigure(CampaignFigure):
    """Table columns: `time_s`, `set_point`, `reference` (if known), `envelope_lower`, `envelope_middle` and
    `envelope_upper` (with many flights), `flight_N` for each flight drawn individually, and `prediction` (if there is
    one) with `prediction_lower` and `prediction_upper` (if its band is known), at those `TABLE_TIMES_S` that lie within
    the experiment.

    Every trace carries `meta`: `role` (target, set point, reference, envelope, flight, legend, prediction, deviation,
    predicted deviation, band, glitch, limit, live, pointed, off scale, off scale deviation) and, for flights, `trial`
    and `standing` (best, latest, baseline, earlier, invalid, unjudged). Every trace has its own `uid`: a flight's is
    `flight-` and its number, that of its deviation `deviation-` and its number. The traces `live`, `live deviation` and
    `pointed` are empty: a page fills the first two during a flight, the last with the flight under the pointer if that
    one has no curve of its own. The set point or the reference, against which the output is scored, is the `target`:
    deviations are counted from it. The altitude limit, `limit`, is hidden: the page on which a flight is observed shows
    it. The axis shows the first 8 s, or with later set points the time from the first of them on; the layout's `meta`
    holds the time range of the whole flight, `whole_s`, and the title of the first one, `opening`. Marks off scale are
    those within the history's window, else within that time. A set point of zero has no deviations: they would repeat
    the output.
    """

    name = "takeoffs"

    @property
    def title(self) -> str:
        return self.history.curves_title

    def compute(self) -> Card:
        history = self.history
        emphasised = select_individual_flights(history)
        recorded = [flight for flight in history.flights if flight.curve]
        drawn = [flight for flight in recorded if flight.number in emphasised]
        in_order = sorted(drawn, key=lambda flight: (_ORDER.index(history.standing_of(flight)), flight.number))
        envelope = envelope_of(recorded, self._lasts_s) if len(drawn) < len(recorded) else None
        points = max(60, min(CURVE_POINTS, ALL_POINTS // max(1, len(drawn))))
        traces = [
            *envelope_traces(self.palette, envelope, history.output_unit),
            *band_traces(self.palette, None if history.proposal is None else history.proposal.band),
            *self._goals(),
            *self._altitude_limit(),
            *self._deviations(in_order),
            *(self._flight(flight, points) for flight in in_order),
            *chain.from_iterable(
                glitch_traces(self.palette, flight.number, flight.curve, flight.glitches, history.output_unit)
                for flight in drawn
            ),
            *self._legend(drawn),
            *self._prediction(),
            self._empty("live", "Flying now"),
            self._empty("pointed", "Pointed at"),
        ]
        low, high, outside = self._span(drawn)
        leaving_top = self._off_scale([drawn[index] for index in outside if index < len(drawn)], low, high)
        leaving = []
        if is_step(history.set_point):
            # Plotly places an axis only if it has a trace with a point, even a missing one.
            traces.append(self._empty("live deviation", "Flying now, deviation", ([None], [None]), yaxis="y2"))
            leaving = off_scale_deviations(
                self.palette,
                drawn,
                history.target,
                self._deviation_limit,
                unit=history.output_unit,
                window=self._visible,
            )
        traces += [*leaving_top, *leaving]
        return self.ready(
            _with_uids(traces),
            summary=self._summary(len(leaving_top), len(leaving)),
            table=self._table(drawn, envelope),
            **self._axes(low, high),
            margin=dict(theme.SIGNED_MARGIN_PX),
            meta={
                "whole_s": self._whole_s,
                "opening": "Steps" if changes_of(history.set_point) else f"First {OPENING_S[1]:g} s",
            },
        )

    @property
    def _lasts_s(self) -> float:
        return float(self.history.set_point.time_s[-1])

    @property
    def _opening_s(self) -> list[float]:
        if changes_s := changes_of(self.history.set_point):
            return [changes_s[0] - _BEFORE_S, self._lasts_s]
        return [OPENING_S[0], min(OPENING_S[1], self._lasts_s)]

    @property
    def _visible(self) -> Range:
        """The visible time range: the one asked for, else the one at first."""
        return self.history.window or Range(*self._opening_s)

    @property
    def _whole_s(self) -> list[float]:
        return [-0.01 * self._lasts_s, self._lasts_s]

    def _axes(self, low: float, high: float) -> dict[str, object]:
        """The output on top, its deviation from the set point below it, over one axis of time."""
        history, unit = self.history, self.history.output_unit
        both = is_step(history.set_point)
        place = [DEVIATION_SHARE + _PANEL_GAP, 1.0] if both else [0.0, 1.0]
        axes: dict[str, object] = {
            "xaxis": self.palette.axis(
                "Time since the command (s)", range=self._opening_s, anchor="y2" if both else "y"
            ),
            "yaxis": self.palette.axis(f"{history.output_title} ({unit})", domain=place, range=[low, high], nticks=7),
        }
        if both:
            axes["yaxis2"] = deviation_axis(self.palette, self._deviation_limit, unit, domain=[0.0, DEVIATION_SHARE])
        return axes

    def _off_scale(self, flights: list[FlightData], low: float, high: float) -> list[Trace]:
        """Marks of the flights that leave the upper panel in the visible time range."""
        parts = ((flight.number, part_off_scale(flight.curve, low, high, self._visible)) for flight in flights)
        unit = self.history.output_unit
        return [
            off_scale(str(number), part, low, high, self.palette.bad, trial=number, text=f"Flight {number}", unit=unit)
            for number, part in parts
            if part
        ]

    def _deviations(self, drawn: list[FlightData]) -> Iterator[Trace]:
        """Output − target of each flight and of the prediction, in the lower panel."""
        if not is_step(self.history.set_point):
            return
        proposal = self.history.proposal
        points = max(60, min(_DEVIATION_POINTS, ALL_POINTS // 3 // max(1, len(drawn))))

        def deviation(name: str, title: str, curve: Curve, look: str, **more: Any) -> Trace:
            return self._trace(
                name,
                deviation_of(curve, self.history.target),
                points,
                line=self.palette.line_of(look),
                showlegend=False,
                yaxis="y2",
                hovertemplate=reading(title, self.history.output_unit, form="+.3f"),
                **more,
            )

        for flight in drawn:
            name, standing = f"Flight {flight.number}, deviation", self.history.standing_of(flight)
            yield deviation(
                name,
                name,
                flight.curve,
                standing,
                role="deviation",
                about={"trial": flight.number, "standing": standing},
                uid=f"deviation-{flight.number}",
                legendgroup=standing,
            )
        if proposal is not None and proposal.curve:
            yield deviation(
                f"{proposal.curve_name}: deviation",
                f"Flight {proposal.number}, {proposal.curve_name.lower()}: deviation",
                proposal.curve,
                "prediction",
                role="predicted deviation",
                about={"trial": proposal.number},
                uid="predicted-deviation",
            )

    @property
    def _deviation_limit(self) -> float:
        """Contains the best, the latest valid and the next flight."""
        shown = [self.history.best, *self.history.valid[-1:], self.history.proposal]
        return deviation_limit([one.curve for one in shown if one is not None], self.history.target)

    def _span(self, drawn: list[FlightData]) -> RobustSpan:
        """From the ground to above the set point; if the set point is zero, the range of the first flight."""
        shown = (*drawn, *self.history.next_flights)
        curves = [flight.curve.values for flight in shown if flight.curve]
        return span_around(self.history.set_point.values, curves, headroom=HEADROOM)

    def _flight(self, flight: FlightData, points: int) -> Trace:
        standing = self.history.standing_of(flight)
        label = {
            "best": f"{flight.number} · {'best' if self.history.is_best_of_best_gains else 'lowest error'}",
            "latest": f"{flight.number} · latest",
            "baseline": f"{flight.number} · latest, baseline",
            "earlier": f"{flight.number}",
            "invalid": f"{flight.number} · {flight.outcome}",
            "unjudged": f"{flight.number} · {flight.outcome}",
        }[standing]
        error = "" if flight.error is None else f"<br>error {short(flight.error)} {self.history.error_unit}"
        return self._trace(
            f"Flight {label}",
            flight.curve,
            points,
            role="flight",
            about={"trial": flight.number, "standing": standing},
            uid=f"flight-{flight.number}",
            line=self.palette.line_of(standing),
            legendrank=500 + flight.number,
            legendgroup=standing,
            showlegend=standing not in SHARED_LEGEND,
            hovertemplate=reading(f"Flight {label}", self.history.output_unit, error),
        )

    def _legend(self, drawn: list[FlightData]) -> list[Trace]:
        """One entry for all flights that look alike, so that the legend does not grow with every flight."""
        standings = {self.history.standing_of(flight) for flight in drawn}
        return [
            scatter(
                name,
                ([None], [None]),
                role="legend",
                about={"standing": standing},
                line=self.palette.line_of(standing),
                legendgroup=standing,
                legendrank=800,
            )
            for standing, name in SHARED_LEGEND.items()
            if standing in standings
        ]

    def _goals(self) -> list[Trace]:
        """Set point, and reference if it is known."""
        goals = (("Set point", self.history.set_point, "dot"), ("Reference", self.history.reference, "dashdot"))
        return [
            scatter(
                name,
                thin_by_bends(curve),
                role="target" if curve is self.history.target else name.lower(),
                line=theme.line(self.palette.dim, 1.5, dash),
                legendrank=900 + place,
            )
            for place, (name, curve, dash) in enumerate(goals)
            if curve is not None
        ]

    def _altitude_limit(self) -> Iterator[Trace]:
        limit_m = self.history.altitude_limit_m
        if limit_m is None:
            return
        yield scatter(
            "Altitude limit: abort",
            (self._whole_s, [limit_m, limit_m]),
            role="limit",
            line=theme.line(self.palette.bad, 2, "longdashdot"),
            legendrank=901,
            visible=False,
        )

    def _prediction(self) -> Iterator[Trace]:
        proposal = self.history.proposal
        if proposal is None or not proposal.curve:
            return
        yield self._trace(
            proposal.curve_name,
            proposal.curve,
            CURVE_POINTS,
            role="prediction",
            about={"trial": proposal.number},
            uid="prediction",
            line=self.palette.line_of("prediction"),
            legendrank=899,
            hovertemplate=reading(f"Flight {proposal.number}, {proposal.curve_name.lower()}", self.history.output_unit),
        )

    def _empty(
        self,
        role: str,
        name: str,
        points: tuple[list[None], list[None]] = ([], []),
        **style: Any,
    ) -> Trace:
        """An empty curve that the page fills."""
        return scatter(
            name,
            points,
            role=role,
            showlegend=False,
            line=theme.line(self.palette.ink, 3.5),
            legendrank=1,
            cliponaxis=True,
            hovertemplate=reading(name, self.history.output_unit),
            **style,
        )

    def _trace(
        self, name: str, curve: Curve, points: int, *, role: str, about: Mapping[str, object], **style: Any
    ) -> Trace:
        each = points // 2 if self.history.window is None else points
        drawn = thinned(curve, each, self._visible)
        return scatter(name, drawn, role=role, about=about, **style)

    def _summary(self, outside: int, leaving: int) -> str:
        history = self.history
        if not history.flights:
            return f"{history.output_title} over time: no flight yet, set point and reference only."
        best = history.best
        found = "" if best is None else f" Best: flight {best.number}, error {short(best.error)} {history.error_unit}."
        off = f" {outside} off scale, marked at the top." if outside else ""
        off += f" Deviation of {leaving} off scale, marked at the edge." if leaving else ""
        return f"{history.output_title} over time: {count(len(history.flights), 'flight')}.{found}{off}"

    def _table(self, drawn: list[FlightData], envelope: Envelope | None) -> Table:
        history, proposal = self.history, self.history.proposal
        named: list[NamedCurve] = [
            ("set_point", "Set point", history.set_point),
            ("reference", "Reference", history.reference),
        ]
        if envelope is not None:
            named += [
                (f"envelope_{edge}", f"{part:.0f}\u00a0% of {envelope.flights} flights lay below", curve)
                for edge, part, curve in zip(("lower", "middle", "upper"), PERCENTILES, envelope.curves, strict=True)
            ]
        named += [(f"flight_{flight.number}", f"Flight {flight.number}", flight.curve) for flight in drawn]
        if proposal is not None and proposal.curve:
            title = f"Flight {proposal.number}, {proposal.curve_name.lower()}"
            named.append(("prediction", title, proposal.curve))
            if proposal.band is not None:
                named.append(("prediction_lower", f"{title}, at least", proposal.band.lower))
                named.append(("prediction_upper", f"{title}, at most", proposal.band.upper))
        times_s = [time_s for time_s in TABLE_TIMES_S if time_s <= self._lasts_s]
        return table_of_curves(times_s, 1, history.output_unit, named)


def _with_uids(traces: list[Trace]) -> list[Trace]:
    """The traces, each with a `uid`: its own, else its role and what it is about.

    Plotly gives a trace without one that of the trace at the same place in the figure before, which may be a flight's.
    """
    about = (cast("Mapping[str, object]", trace["meta"]).values() for trace in traces)
    uids = ("-".join(map(str, each)).replace(" ", "-") for each in about)
    return [{"uid": uid, **trace} for uid, trace in zip(uids, traces, strict=True)]
