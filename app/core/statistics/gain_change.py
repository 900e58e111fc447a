"""Which of two logs' gains suit the vehicle better, whatever manoeuvre and weather each was flown in.

The errors measured do not tell: a calm morning and a windy noon differ by more than most gains do. So the model of each
flight, with the copters that it allows, flies its own manoeuvre in its own weather with both gain sets, and in weather
as strong at other times, which gives the scatter of single flights. The difference is the mean over both flights'
manoeuvres and weathers. It is judged as two single flights of a campaign are: better is what flies better nine times of
ten, and what no two flights would show is unresolved, however sure the model is of its sign.

The change of the measured error is that by the gains, that by the manoeuvre, as in still air, and the rest, which is
due to the weather. Where this rest turns what the gains do into the opposite, beyond the scatter of single flights, the
flights contradict the verdict: the weather has changed much, or the model is blind to what happened.

Takeoffs are compared without a model, as flights of a campaign: they all fly the same manoeuvre, and several of them
with the same gains are repeats.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop, LoggedFlight
from app.core.analysis.prediction import STRENGTH_DEVIATION, FlightModel
from app.core.experiments.takeoff import Takeoff
from app.core.models.copter import Copter
from app.core.policy import Gains
from app.core.records.trajectory import Samples
from app.core.statistics.comparisons import Comparison, Group, PooledScatter, Verdict, compare, pool_scatter
from app.core.statistics.pairs import CONFIDENCE

COMPARED_S: Final = 10.0
_SAME: Final = 1e-4
_FREEDOM: Final = 1.0 / STRENGTH_DEVIATION**2
"""Degrees of freedom of the scatter, by how well each of two flights tells the strength of its weather."""
_BEYOND: Final = 1.645
"""Standard errors."""
_EVERY_COPTER: Final = 2


class Basis(StrEnum):
    """What a comparison of two logs rests on: both flights' models; repeated takeoffs; or nothing but the measured
    errors, because the gains are the same, or one of the logs does not have what a comparison needs."""

    MODELS = "models"
    TAKEOFFS = "takeoffs"
    SAME_GAINS = "same gains"
    NOT_COMPARABLE = "not comparable"


@dataclass(frozen=True, slots=True, kw_only=True)
class FlownLog:
    """One of two logs: its measured error, m, if it has one; its flight, and the copters that this allows, if it has a
    model."""

    error_m: float | None
    flight: LoggedFlight | None = None
    copters: Sequence[Copter] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoredTakeoff:
    """A takeoff of a log: its gains, and its error, m, in the first 10 s, which all takeoffs last."""

    gains: Gains
    error_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GainChange:
    """The later of two logs compared with the earlier one; all differences are later − earlier, m.

    `comparison` is that of the gains, None where these are not compared. `measured_m` is the difference of the measured
    errors, and `by_manoeuvre_m` what of it the models attribute to the manoeuvre; None where that is not known.
    """

    basis: Basis
    comparison: Comparison | None = None
    measured_m: float | None
    by_manoeuvre_m: float | None = None

    @property
    def verdict(self) -> Verdict | None:
        """Whether the later gains are better; None if they are the same."""
        if self.basis is Basis.SAME_GAINS:
            return None
        return "not known yet" if self.comparison is None else self.comparison.verdict

    @property
    def by_gains_m(self) -> float | None:
        """What of the measured difference the models attribute to the gains."""
        return self.comparison.difference if self.comparison and self.basis is Basis.MODELS else None

    @property
    def by_weather_m(self) -> float | None:
        """The rest of the measured difference."""
        if self.measured_m is None or self.by_gains_m is None or self.by_manoeuvre_m is None:
            return None
        return self.measured_m - self.by_gains_m - self.by_manoeuvre_m

    @property
    def is_contradicted(self) -> bool:
        """Whether, but for the manoeuvre, the flights went the other way than the verdict says, beyond their
        scatter."""
        by_models, gains_m, weather_m = self.comparison, self.by_gains_m, self.by_weather_m
        if by_models is None or by_models.standard_error is None or gains_m is None or weather_m is None:
            return False
        is_decided, is_opposite = by_models.verdict in ("better", "worse"), (gains_m + weather_m) * gains_m < 0.0
        return is_decided and is_opposite and abs(weather_m) > _BEYOND * by_models.standard_error


def compare_logs(earlier: FlownLog, later: FlownLog) -> GainChange:
    """Compare the gains of two logs of one vehicle; deterministic, takes a fraction of a second."""
    measured_m = None if earlier.error_m is None or later.error_m is None else later.error_m - earlier.error_m
    before, after = earlier.flight, later.flight
    if before is None or after is None or before.loop.texts.autopilot != after.loop.texts.autopilot:
        return GainChange(basis=Basis.NOT_COMPARABLE, measured_m=measured_m)
    if has_same_gains(before.loop, after.loop):
        return GainChange(basis=Basis.SAME_GAINS, measured_m=measured_m)
    if before.lacks or after.lacks:
        return GainChange(basis=Basis.NOT_COMPARABLE, measured_m=measured_m)
    models = [FlightModel(each, log.copters[::_EVERY_COPTER]) for each, log in ((before, earlier), (after, later))]
    loops = (before.loop, tuned(before.loop, after.loop)), (tuned(after.loop, before.loop), after.loop)
    errors = [model.errors_m(*both) for model, both in zip(models, loops, strict=True)]
    still_m = [model.still_m(*both).mean() for model, both in zip(models, loops, strict=True)]
    return GainChange(
        basis=Basis.MODELS,
        comparison=_compared(errors, (before.loop.gains, after.loop.gains)),
        measured_m=measured_m,
        by_manoeuvre_m=float(still_m[1] - still_m[0]),
    )


def compare_takeoffs(earlier: Sequence[ScoredTakeoff], later: Sequence[ScoredTakeoff]) -> GainChange:
    """Compare the last gains of two logs of at least a takeoff each, by all takeoffs with these in both."""
    found: dict[frozenset[tuple[str, float]], list[float]] = {}
    for each in (*earlier, *later):
        found.setdefault(frozenset(each.gains.items()), []).append(each.error_m)
    groups = {gains: Group(dict(gains), (*range(len(errors)),), (*errors,)) for gains, errors in found.items()}
    first, second = (groups[frozenset(log[-1].gains.items())] for log in (earlier, later))
    measured_m = later[-1].error_m - earlier[-1].error_m
    if first is second:
        return GainChange(basis=Basis.SAME_GAINS, measured_m=measured_m)
    scatter = pool_scatter((*groups.values(),), Takeoff(window_s=COMPARED_S).scatter)
    comparison = compare(second, first, scatter, CONFIDENCE)
    return GainChange(basis=Basis.TAKEOFFS, comparison=comparison, measured_m=measured_m)


def tuned(loop: AltitudeLoop, like: AltitudeLoop) -> AltitudeLoop:
    """The loop with all parameters of another one but for the hover throttle."""
    hover = loop.texts.hover_parameter
    return loop.with_gains({name: value for name, value in like.firmware_parameters.items() if name != hover})


def has_same_gains(before: AltitudeLoop, after: AltitudeLoop) -> bool:
    """Whether nothing that a pilot tunes differs: by the names and units of the vehicle's release, or where an update
    changed these, of the loop."""
    own, other = before.firmware_parameters, tuned(before, after).firmware_parameters
    others = [{name: each[name] for name in own.keys() - before.gains.keys()} for each in (own, other)]
    gains = [each.named(each.gains) for each in (before, after)]
    if gains[0].keys() != gains[1].keys():
        gains = [before.gains, after.gains]
    return _is_same(*others) and _is_same(*gains)


def _is_same(some: Mapping[str, float], others: Mapping[str, float]) -> bool:
    return all(math.isclose(some[name], others[name], rel_tol=_SAME) for name in some)


def _compared(both: Sequence[tuple[Samples, Samples]], gains: tuple[Gains, Gains]) -> Comparison:
    """As two single flights, one with each gain set, whose scatter contains what the copters of a flight disagree
    about. `both` have the errors of each copter with these gains, m, shape (2, k), in the weather of one of the flights
    and at other times."""
    errors_m = np.mean([0.5 * (now + then).mean(axis=1) for now, then in both], axis=0).tolist()
    scatter = np.mean([np.var(then, axis=1, ddof=1) for _, then in both])
    model = np.sum([np.var(now[1] - now[0], ddof=1) for now, _ in both]) / len(both) ** 2
    earlier, later = (Group(some, (1,), (error_m,)) for some, error_m in zip(gains, errors_m, strict=True))
    pooled = PooledScatter(sigma=float(np.sqrt(scatter + 0.5 * model)), degrees_of_freedom=_FREEDOM)
    return compare(later, earlier, pooled, CONFIDENCE)
