"""The answer to a log: how the altitude loop behaves, the vehicle behind it, and gains for it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np

from app.core.analysis.hover import HoverAdvice, advise_hover
from app.core.analysis.loop import AltitudeLoop, LoggedFlight
from app.core.analysis.margin import REQUIRED_MARGIN, gain_margin
from app.core.analysis.prediction import FlightModel, Prediction
from app.core.analysis.proposal import propose
from app.core.analysis.vehicle_fit import CopterEstimate, fit_copter
from app.core.models.copter import FLOWN
from app.core.reasons import Reason, ReasonCode, refusal
from app.core.records.trajectory import Samples

_SHORTEST_S: Final = 6.0
_LEAST_CHANGE_M: Final = 0.3
_LEAST_RATE_CHANGE_M_S: Final = 0.1
_LARGEST_SATURATION: Final = 0.05
_LEAST_VARIATION: Final = 1e-6
_OTHER_CONTROLLER_SHARE: Final = 0.05
_LARGEST_RESIDUAL_M_S2: Final = 1.5
_LARGEST_MISFIT: Final = (0.005, 0.25)
_LARGEST_SLOPE_DEVIATION: Final = 0.15


class Grade(StrEnum):
    """How much a log answers: gains are judged; the vehicle is fitted, or its hover throttle known, and no gains are
    proposed; the flight is described; nothing."""

    FULL = "full"
    PARTIAL = "partial"
    DESCRIPTION = "description"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """The flight itself: analysed time, s; mean and largest distance between reference and altitude, m; range of the
    reference, m; mean throttle, and share of the rows with the throttle at a limit."""

    duration_s: float
    error_m: float
    largest_deviation_m: float
    reference_range_m: float
    throttle_mean: float
    saturated_share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment:
    """A gain set on the copters that the flight allows, by the names of the vehicle's release.

    `activity`, relative to the gains of the flight, and `margin` are those of the likeliest copter; 0 if it rings.
    """

    name: str
    gains: Mapping[str, float]
    prediction: Prediction
    activity: float
    margin: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """The segment with the largest altitude change as it was flown, and as it is predicted with the proposed gains, at
    its rows, shape (n,) each; without a proposal, with the gains of the flight. Time counts from the first segment."""

    time_s: Samples
    reference_m: Samples
    flown_m: Samples
    flown_throttle: Samples
    predicted_m: Samples
    predicted_throttle: Samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """Everything that a log answers. `loop` is that of the flight. `assessments` begins with the gains of the flight;
    `proposed` is None if the log does not suffice, no gains do, or none are better, which `why_none` then says.
    `at_limit` names proposed gains at an end of the range that was searched. `hover` is a better value of the parameter
    for the hover throttle, if the present one does not suit; if the vehicle is outside what the loop finds in flight,
    all assessments but the first, and `response`, are with this value."""

    loop: AltitudeLoop
    behaviour: Behaviour
    estimate: CopterEstimate
    assessments: Sequence[Assessment]
    proposed: Assessment | None
    why_none: Reason | None
    at_limit: Sequence[str]
    response: Response
    hover: HoverAdvice | None

    @property
    def grade(self) -> Grade:
        """Full if gains are judged, even if none are better."""
        return Grade.PARTIAL if self.why_none is not None and self.why_none.code in _NOT_JUDGED else Grade.FULL

    @property
    def answer(self) -> str:
        """The answer in a few sentences."""
        hover = self.hover
        return f"{self._about_gains} {hover.reason}" if hover is not None and hover.is_outside else self._about_gains

    @property
    def _about_gains(self) -> str:
        flown, proposed = self.assessments[0], self.proposed
        if (why := self.why_none) is not None:
            return {
                ReasonCode.NONE_BETTER: f"Keep the gains flown: the log {why.text}.",
                ReasonCode.MARGIN_UNREACHABLE: f"The log {why.text}. Reduce its lags first: {self.loop.texts.lags}.",
            }.get(why.code, f"The log does not suffice to propose gains: it {why.text}. {self.loop.texts.what_to_fly}")
        assert proposed is not None
        measured = f"Mean deviation: {_mm(self.behaviour.error_m)} measured."
        if proposed.prediction.error_m > _BETTER * flown.prediction.error_m:
            return (
                f"{measured} The model predicts about the same for the proposed gains, with a margin of "
                f"{proposed.margin:.1f} instead of {f'{flown.margin:.1f}' if flown.margin else 'less than 1'}."
            )
        low, high = (f"{1e3 * each:.1f}" for each in (proposed.prediction.low_m, proposed.prediction.high_m))
        return (
            f"{measured} The model predicts {_mm(flown.prediction.error_m)} for the gains flown, and "
            f"{_mm(proposed.prediction.error_m)} ({low} … {high} mm) for the proposed ones.{self._about_usual}"
        )

    @property
    def _about_usual(self) -> str:
        """The sets that are set without a log and not above the interval of the proposed one: no flight would tell them
        apart."""
        proposed = self.proposed
        assert proposed is not None
        found = [
            f" {', '.join(f'{value:g}' for value in each.gains.values())} is predicted as good: "
            f"{_mm(each.prediction.error_m)}, with {each.activity:.1f} times the throttle activity of the gains flown."
            for each in self.assessments[1:]
            if each.prediction.error_m <= proposed.prediction.high_m and each.margin >= REQUIRED_MARGIN
            if each.gains != proposed.gains
        ]
        return "".join(found)

    def parameter_file(self, file_name: str) -> str | None:
        """The proposed gains and hover throttle as a ground station loads them, with those flown as comments; None if
        neither is proposed."""
        proposed, hover = self.proposed, self.hover
        if proposed is None and hover is None:
            return None
        gains = ({}, {}) if proposed is None else (self.assessments[0].gains, proposed.gains)
        setting = ({}, {}) if hover is None else ({hover.parameter: hover.present}, {hover.parameter: hover.proposed})
        lines = [
            f"# Gainline, from {file_name}. Load on the ground; fly first at a safe height, ready to take over.",
            *([] if hover is None else [f"# {hover.reason}"]),
            *self.loop.parameter_lines(*({**some, **other} for some, other in zip(gains, setting, strict=True))),
        ]
        return "\n".join((*lines, ""))


def _mm(error_m: float) -> str:
    return f"{1e3 * error_m:.1f} mm"


def analyze(flight: LoggedFlight) -> Analysis:
    """Analyse a flight; deterministic, takes some seconds.

    Raises TrajectoryError if the flight contains nothing to learn from, or something that no copter of the model does.
    """
    loop, behaviour = flight.loop, _behaviour(flight)
    _require_none(loop, _obstacles(flight, behaviour))
    estimate = fit_copter(flight)
    assess = _assessor(flight, estimate)
    present = assess("As flown", loop.gains)
    _require_none(loop, _differences(behaviour, estimate, present))
    hover = advise_hover(loop, estimate.mean.hover_throttle)
    if hover is not None and hover.is_outside:
        flight = flight.with_hover(hover.proposed)
        assess = _assessor(flight, estimate)
    why = flight.lacks or _insufficient(flight, estimate)
    usual = {} if flight.lacks else loop.rules(flight.throttle_mean)
    compared = [present, *(assess(name, gains) for name, gains in usual.items())]
    gains = None if why else propose(flight, estimate.few, [loop.gains, *usual.values()])
    proposed = assess("Proposed", gains) if gains else None
    if proposed is None:
        why = why or Reason(code=ReasonCode.MARGIN_UNREACHABLE)
    elif not _is_better(proposed, present):
        gains, proposed, why = None, None, Reason(code=ReasonCode.NONE_BETTER)
    return Analysis(
        loop=loop,
        behaviour=behaviour,
        estimate=estimate,
        assessments=tuple(compared),
        proposed=proposed,
        why_none=why,
        at_limit=[*loop.named({name: gains[name] for name in loop.space.at_limit(gains)})] if gains else [],
        response=_response(flight, estimate, gains or loop.gains),
        hover=hover,
    )


def _assessor(flight: LoggedFlight, estimate: CopterEstimate) -> Callable[[str, Mapping[str, float]], Assessment]:
    """What assesses a named gain set."""
    flown, model = flight.loop, FlightModel(flight, estimate.draws)
    likeliest = FlightModel(flight, [estimate.mean])
    activity = likeliest.fly(flown)[1]

    def assess(name: str, gains: Mapping[str, float]) -> Assessment:
        loop = flown.with_gains(gains)
        return Assessment(
            name=name,
            gains=flown.named(gains),
            prediction=model.predict(loop),
            activity=likeliest.fly(loop)[1] / activity,
            margin=gain_margin(loop, estimate.mean),
        )

    return assess


def _is_better(proposed: Assessment, present: Assessment) -> bool:
    """Whether it deviates less, or keeps a margin that the present gains lack."""
    deviates_less = proposed.prediction.error_m <= _BETTER * present.prediction.error_m
    return deviates_less or present.margin < REQUIRED_MARGIN <= proposed.margin


_BETTER: Final = 0.95
_NOT_JUDGED: Final = (ReasonCode.FEED_FORWARD_UNKNOWN, ReasonCode.NO_WHOLE_CHANGE, ReasonCode.SLOPE_UNKNOWN)


def _response(flight: LoggedFlight, estimate: CopterEstimate, gains: Mapping[str, float]) -> Response:
    segment = max(flight.segments, key=lambda each: float(np.ptp(each.z_d_m)))
    alone = replace(flight, segments=[segment])
    rows = FlightModel(alone, [estimate.mean]).rows(flight.loop.with_gains(gains))
    return Response(
        time_s=segment.time_s - flight.segments[0].time_s[0],
        reference_m=segment.z_d_m,
        flown_m=segment.z_m,
        flown_throttle=segment.throttle_filtered,
        predicted_m=rows[:, FLOWN.index("z_m")],
        predicted_throttle=rows[:, FLOWN.index("throttle_filtered")],
    )


def _behaviour(flight: LoggedFlight) -> Behaviour:
    deviation = np.concatenate([np.abs(each.z_d_m - each.z_m)[each.scored] for each in flight.segments])
    reference = [each.z_d_m[each.scored] for each in flight.segments]
    throttle = np.concatenate([each.throttle[each.scored] for each in flight.segments])
    least, most = flight.loop.throttle_limits
    return Behaviour(
        duration_s=sum(each.duration_s for each in flight.segments),
        error_m=flight.error_m,
        largest_deviation_m=float(deviation.max()),
        reference_range_m=max(float(np.ptp(each)) for each in reference),
        throttle_mean=flight.throttle_mean,
        saturated_share=float(np.mean((throttle <= least) | (throttle >= most))),
    )


def _require_none(loop: AltitudeLoop, reasons: Iterator[Reason]) -> None:
    """Raise TrajectoryError with the first reason, if there is one."""
    if (reason := next(reasons, None)) is not None:
        raise refusal("The log cannot be analysed.", loop.texts.what_to_fly, [reason])


def _obstacles(flight: LoggedFlight, behaviour: Behaviour) -> Iterator[Reason]:
    """Why nothing can be learned from a flight: altitude hardly changes, acceleration and throttle are constant, as in
    messages that nobody filled in, or the climb rate target is not what the replica's position controller computes."""
    if behaviour.duration_s < _SHORTEST_S:
        numbers = {"analysed_s": behaviour.duration_s, "needed_s": _SHORTEST_S}
        yield Reason(code=ReasonCode.TOO_SHORT, numbers=numbers)
    if behaviour.reference_range_m < _LEAST_CHANGE_M:
        numbers = {"reference_range_m": behaviour.reference_range_m, "needed_m": _LEAST_CHANGE_M}
        yield Reason(code=ReasonCode.NO_ALTITUDE_CHANGES, numbers=numbers)
    if behaviour.saturated_share > _LARGEST_SATURATION:
        yield Reason(code=ReasonCode.SATURATED, numbers={"saturated_share": behaviour.saturated_share})
    for each in flight.segments:
        signals = (("acceleration", each.a_m_s2), ("throttle", each.throttle_filtered))
        if constant := [name for name, values in signals if np.ptp(values) < _LEAST_VARIATION]:
            yield Reason(code=ReasonCode.CONSTANT_SIGNAL, named=constant)
    loop = flight.loop
    apart = np.concatenate([np.abs(loop.climb_rate_targets(each) - each.v_t_m_s) for each in flight.segments])
    differing = int(np.sum(apart > loop.target_tolerance_m_s))
    if differing > _OTHER_CONTROLLER_SHARE * len(apart):
        numbers = {"differing_rows": differing, "rows": len(apart)}
        yield Reason(code=ReasonCode.OTHER_CONTROLLER, numbers=numbers)


def find_unexplained(estimate: CopterEstimate) -> Reason | None:
    """Why no copter of the model flies so, or None if one may: accelerations that it does not explain."""
    if estimate.residual_m_s2 <= _LARGEST_RESIDUAL_M_S2:
        return None
    numbers = {"residual_m_s2": estimate.residual_m_s2}
    return Reason(code=ReasonCode.UNEXPLAINED_ACCELERATIONS, numbers=numbers)


def is_alike(flown_m: float, modelled_m: float) -> bool:
    """Whether the model with the gains of a flight deviates about as much as the flight did, m."""
    least_m, share = _LARGEST_MISFIT
    return abs(modelled_m - flown_m) <= max(least_m, share * flown_m)


def _differences(behaviour: Behaviour, estimate: CopterEstimate, present: Assessment) -> Iterator[Reason]:
    """Why the flight is not that of a copter of the model."""
    if (why := find_unexplained(estimate)) is not None:
        yield why
    if not is_alike(behaviour.error_m, present.prediction.error_m):
        numbers = {"flown_mm": 1e3 * behaviour.error_m, "modelled_mm": 1e3 * present.prediction.error_m}
        yield Reason(code=ReasonCode.DEVIATION_NOT_EXPLAINED, numbers=numbers)


def _insufficient(flight: LoggedFlight, estimate: CopterEstimate) -> Reason | None:
    known_to = estimate.deviation.thrust_slope
    if not _begins_and_ends_a_change(flight):
        return Reason(code=ReasonCode.NO_WHOLE_CHANGE)
    if known_to > _LARGEST_SLOPE_DEVIATION:
        numbers = {"thrust_slope_deviation": known_to, "needed_deviation": _LARGEST_SLOPE_DEVIATION}
        return Reason(code=ReasonCode.SLOPE_UNKNOWN, numbers=numbers)
    return None


def _begins_and_ends_a_change(flight: LoggedFlight) -> bool:
    """Whether the climb rate that follows from the reference both rises and falls in the scored rows."""
    loop, throttle = flight.loop, flight.throttle_mean
    rates = [loop.excitation(each, throttle)[0][each.scored] for each in flight.segments]
    rises = [float(np.max(each - np.minimum.accumulate(each))) for each in rates]
    falls = [float(np.max(np.maximum.accumulate(each) - each)) for each in rates]
    return min(max(rises), max(falls)) >= _LEAST_RATE_CHANGE_M_S
