"""The paper's Fig. 12: one policy flown repeatedly on one battery, for the scatter and trend of its errors.

The paper flew one battery with each of two gain sets. Here many batteries are flown on the twin, to separate the
scatter of σ between batteries from σ itself: σ is pooled over the groups, √(Σ (e − ē)² / Σ (n − 1)).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.autopilots.registry import get_experiment
from app.core.definition import flight_seed
from app.core.experiments.base import Matrix, Scatter
from app.core.formatting import number, short_percent
from app.core.policy import Vector
from app.core.statistics.comparisons import Group, pool_scatter, trend_of
from app.figures.panels import Line, Panel, Plot, Style
from app.reproductions.results import OVERRULE, Progress, Result, Row, counted, marks
from app.reproductions.tables import overruled_for
from app.vehicles.registry import check_options
from app.vehicles.simulated import simulate_flight, trajectory_of
from app.vehicles.twin import TwinFlight

REPEATS: Final = 10
FADE: Final = 0.005
"""Loss of thrust of the control experiment's battery from the first to the last flight, as a share."""
CONFIDENCE: Final = 0.9
SEED: Final = 1


@dataclass(frozen=True, slots=True)
class RepeatedPolicy:
    """A gain set that the paper repeated: its published σ, and the error of its one flight in Table 2, both in m."""

    title: str
    gains: tuple[int, int, int]
    paper_sigma: float
    paper_error: float


POLICIES: Final = (
    RepeatedPolicy("Default gains 283, 13, 82", (283, 13, 82), 0.0141, 0.5102),
    RepeatedPolicy("Tuned gains 1624, 1356, 195", (1624, 1356, 195), 0.0066, 0.1218),
)


@dataclass(frozen=True, slots=True)
class Repeats:
    """Errors in m of shape (groups, repeats), in the order of the flights, on steady and on fading batteries.

    `overruled` is the reason for flying the gains although the gate refuses them.
    """

    steady: Matrix
    fading: Matrix
    overruled: str


def run_variability(on_progress: Progress, *, groups: int = 200, fading_groups: int = 40) -> Result:
    """Fly both policies on `groups` batteries of ten flights each; `groups` and `fading_groups` ≥ 1."""
    tell = counted(on_progress, len(POLICIES) * (groups + fading_groups))
    found = [_fly(policy, groups, fading_groups, tell) for policy in POLICIES]
    return Result(
        rows=tuple(row for policy, flown in zip(POLICIES, found, strict=True) for row in _rows(policy, flown)),
        figures={"figure12": _plot([flown.steady[0] for flown in found])},
        notes=(
            (
                f"{groups} batteries of {REPEATS} flights each with both gain sets, on the twin with the real "
                "drone's scatter. The scatter should be within 40 % of the paper's, which comes from a single "
                "battery."
            ),
            (
                f"A trend is the slope of the error over the {REPEATS} flights of a battery; it counts as resolved "
                f"if its {short_percent(CONFIDENCE)} interval excludes zero, which happens by chance on "
                f"{short_percent(1 - CONFIDENCE)} of steady batteries. The fading battery is {short_percent(FADE)} "
                "weaker in its last flight than in its first."
            ),
            (
                "Both gain sets are checked by a campaign's gate first. ki = 1356 can overflow and is flown by "
                f"overruling the gate. The recorded reason: {OVERRULE}."
            ),
        ),
    )


def repeated_errors(gains: tuple[int, int, int], *, seed: int, group: int, fade: float = 0.0) -> Vector:
    """Errors of ten flights of one policy on one battery of the twin, shape (10,).

    The flights differ by the twin's scatter and, with `fade`, by the thrust, which falls by that share over the ten
    flights.
    """
    options = {name: float(value) for name, value in check_options("twin", {}).items()}
    hover = options["hover_throttle"]
    errors = np.empty(REPEATS)
    for flight in range(REPEATS):
        weaker = 1.0 - fade * flight / (REPEATS - 1)
        flown = TwinFlight(
            {**options, "hover_throttle": hover / weaker}, flight_seed(seed, group * REPEATS + flight + 1)
        )
        errors[flight] = get_experiment("takeoff").error(trajectory_of(simulate_flight(flown, _named(gains)), "twin"))
    return errors


def _named(gains: tuple[int, int, int]) -> dict[str, float]:
    return dict(zip(get_experiment("takeoff").space.names, map(float, gains), strict=True))


def _fly(policy: RepeatedPolicy, groups: int, fading_groups: int, tell: Callable[[str], None]) -> Repeats:
    overruled = overruled_for(_named(policy.gains), "twin")
    flown: list[Vector] = []
    for group in range(groups + fading_groups):
        fade = FADE if group >= groups else 0.0
        flown.append(repeated_errors(policy.gains, seed=SEED, group=group, fade=fade))
        tell(f"{policy.title}: battery {len(flown)} of {groups + fading_groups} flown")
    return Repeats(np.array(flown[:groups]), np.array(flown[groups:]), overruled)


def pooled_sigma(errors: Matrix) -> float:
    """σ in the errors' unit, pooled over the rows of (groups, repeats)."""
    groups = [Group(gains={}, numbers=(), errors=tuple(row)) for row in errors.tolist()]
    return pool_scatter(groups, prior=Scatter(sd=0.0, degrees_of_freedom=0.0)).sigma


def share_with_trend(errors: Matrix) -> float:
    """Share of batteries, rows of (groups, repeats), with a resolved trend."""
    trends = [trend_of(range(errors.shape[1]), row, CONFIDENCE) for row in errors.tolist()]
    return float(np.mean([trend is not None and trend.is_resolved for trend in trends]))


def _rows(policy: RepeatedPolicy, flown: Repeats) -> Iterator[Row]:
    yield _sigma_row(policy, flown)
    mean = float(flown.steady.mean())
    yield Row(
        group=policy.title,
        label="mean error",
        unit="m",
        measured=mean,
        paper=policy.paper_error,
        ratio=mean / policy.paper_error,
        note="published: the one flight of Table 2",
        gains=_named(policy.gains),
        overruled=flown.overruled,
    )
    yield _trend_row(policy, flown.steady)
    yield Row(
        group=policy.title,
        label="steady batteries that show a trend",
        unit="share",
        measured=share_with_trend(flown.steady),
        reference=1.0 - CONFIDENCE,
        digits=3,
        note="expected by chance",
    )
    yield Row(
        group=policy.title,
        label=f"batteries fading by {short_percent(FADE)} that show one",
        unit="share",
        measured=share_with_trend(flown.fading),
        digits=3,
        note="detected in ten flights",
    )


def _sigma_row(policy: RepeatedPolicy, flown: Repeats) -> Row:
    sigma, own = pooled_sigma(flown.steady), flown.steady.std(axis=1, ddof=1)
    low, high = np.quantile(own, (0.05, 0.95))
    return Row(
        group=policy.title,
        label="σ of repeated flights",
        unit="m",
        measured=sigma,
        paper=policy.paper_sigma,
        ratio=sigma / policy.paper_sigma,
        note=f"a single battery shows {low:.4f} … {high:.4f} m (5th to 95th of 100)",
        gains=_named(policy.gains),
        overruled=flown.overruled,
    )


def _trend_row(policy: RepeatedPolicy, errors: Matrix) -> Row:
    place = np.tile(np.arange(errors.shape[1], dtype=np.float64), len(errors))
    centred = errors - errors.mean(axis=1, keepdims=True)
    trend = trend_of(place.tolist(), centred.ravel().tolist(), CONFIDENCE)
    assert trend is not None
    return Row(
        group=policy.title,
        label="trend over a battery",
        unit="mm per flight",
        measured=1000.0 * trend.slope,
        reference=0.0,
        digits=3,
        note=f"{short_percent(CONFIDENCE)} interval {number(1000.0 * trend.lower)} … {number(1000.0 * trend.upper)}; "
        "published: none",
        numbers={"lower_mm": 1000.0 * trend.lower, "upper_mm": 1000.0 * trend.upper},
    )


def _plot(batteries: list[Vector]) -> Plot:
    """The first battery of each policy; the paper also shows one of each."""
    spread = [float(errors.std(ddof=1)) for errors in batteries]
    return Plot(
        title="ten takeoffs on one battery",
        summary="Errors of ten flights on one battery, with their mean ± σ: "
        + "; ".join(
            f"{policy.title.lower()}: {errors.mean():.4f} ± {sd:.4f} m"
            for policy, errors, sd in zip(POLICIES, batteries, spread, strict=True)
        )
        + ".",
        x_title="Flight on the battery",
        x_range=(0.5, REPEATS + 0.5),
        x_digits=0,
        panels=tuple(
            Panel(y_title=f"{title}: error (m)", lines=_lines(errors, sd), digits=4, y_range=_around(errors, sd))
            for title, errors, sd in zip(("Default", "Tuned"), batteries, spread, strict=True)
        ),
    )


def _around(errors: Vector, sd: float) -> tuple[float, float]:
    low, high = min(errors.min(), errors.mean() - sd), max(errors.max(), errors.mean() + sd)
    return round(float(low - 0.5 * sd), 6), round(float(high + 0.5 * sd), 6)


def _lines(errors: Vector, sd: float) -> tuple[Line, ...]:
    ends, mean = (0.5, REPEATS + 0.5), float(errors.mean())

    def level(name: str, style: Style, value: float) -> Line:
        return Line(name=name, style=style, x=ends, y=(round(value, 6), round(value, 6)))

    return (
        level("Mean", "mean", mean),
        level("Mean − σ", "spread", mean - sd),
        level("Mean + σ", "spread", mean + sd),
        marks("Flights", "run 1", np.arange(1.0, len(errors) + 1.0), errors),
    )
