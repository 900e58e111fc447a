"""The paper's F-16 experiment (its figures 2, 3 and 4), and a comparison of methods over many inaccurate models."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Final

import numpy as np

from app.core.experiments.pitch_tracking import OUTPUT, PitchTracking
from app.core.formatting import short_percent
from app.core.policy import Vector
from app.core.records.trajectory import Trajectory
from app.core.tuning.corrected_model import model_optimum
from app.figures.panels import Line, Panel, Plot, Style
from app.reproductions.f16_campaigns import (
    BEST_ERROR,
    MAX_FLIGHTS,
    METHODS,
    PAPER_FLIGHTS,
    PAPER_NEAR_OPTIMAL_AFTER,
    SHOWCASE_SEED,
    MethodResult,
    Showcase,
    flights_to_optimum,
    showcase,
    start,
    study,
    true_errors,
    truth,
)
from app.reproductions.results import Progress, Result, Row, counted, curve, marks

PERTURBATION: Final = 0.45
SEEDS: Final = 50
BRIEF_SEEDS: Final = 10
EXPECTED_START: Final = {0.2: 1.15, 0.45: 1.90, 0.8: 7.2}
"""Median error of the model's optimum on the true system, relative to the true optimum's, at each perturbation."""
EXPECTED: Final = {
    "raw": (0.13, 24.5),
    "outside": (0.45, 4.0),
    "inside": (0.71, 4.0),
    "identified": (1.0, 2.0),
    "simplex": (1.0, 26.0),
}
"""Results of a prototype by method: the share of 50 models at ±45 % for which it came near, and its median flights."""
EXPECTED_NOISY: Final = {"identified-noisy": (0.55, 2.0), "map-noisy": (1.0, 2.0)}
"""The same with noisy logs; least squares came near for 50 to 60 %.

The flights with noise were not reported: two is the value without noise.
"""
AT_LEAST_SECOND: Final = 0.98
"""Required share of models, 49 of 50, for which the identified model comes near by the second flight."""
NOISY_FLIGHTS: Final = 5
"""Flights of a campaign with noisy logs."""
PROTOTYPE_NEAR: Final = 18.0
"""Flights until near the optimum in the prototype's showcase."""

_SEARCHES: Final = 4
_STYLES: Final[tuple[Style, ...]] = ("run 1", "run 2", "run 3", "run 4", "run 5", "run 6")
_FROM_SHOWCASE: Final = 0.05
_FROM_STARTS: Final = 0.4
"""Shares of the total progress at which the starts and the comparison of methods begin."""


def run_f16(on_progress: Progress, full: bool) -> Result:
    """Run the showcase, the starts over 50 models, and the methods over 10 of them.

    In full, the methods run over all 50, and the identified model also at the other perturbations and with noisy logs.
    """
    seeds = range(SEEDS if full else BRIEF_SEEDS)
    on_progress(0.0, "the showcase campaign")
    shown = showcase()
    starts = tuple(_starts(on_progress))

    methods = tuple(_methods(_FULL if full else _BRIEF, seeds, on_progress))
    return Result(
        rows=(*_definition(), *_showcase(shown), *starts, *methods),
        figures=_figures(shown),
        notes=(
            (
                "The paper gives no flight condition, reference amplitude, bounds or step sizes; this reproduces "
                "the shape of its figures. The bounds are ours, and the optimum lies on three of them: without bounds "
                "its error falls below 0.01 rad·s, at far larger gains."
            ),
            (
                f"The showcase is the inaccurate model of seed {SHOWCASE_SEED} at ±45 %, chosen because its campaign "
                "looks like the paper's. It flies the paper's method with the gradient scaled by each gain's scale."
            ),
            (
                f"Methods are compared over the inaccurate models of seeds 0 to {seeds[-1]}; the expected figures come "
                f"from {SEEDS}. Near means within 5 % of the true optimum within our bounds."
            ),
        ),
    )


def _definition() -> Iterator[Row]:
    group = "The definition"
    space = PitchTracking.space
    for label, gains, reference, digits in (
        ("error with every gain zero", np.zeros(len(space.gains)), 6.66664, 5),
        ("error with the hand gains", space.default, 3.38180, 5),
        ("error of the true optimum within our bounds", _optimum(), BEST_ERROR, 6),
    ):
        yield Row(
            group=group, label=label, unit="rad·s", measured=true_errors([gains])[0], reference=reference, digits=digits
        )


def _optimum() -> Vector:
    """The true local optimum within the bounds, searched from its value known to three digits: shape (6,)."""
    gains = np.array([-20.0, -50.0, -57.3, -14.796, -4.210, -0.008])
    for _ in range(_SEARCHES):
        gains = model_optimum(truth(), PitchTracking.space, gains).gains
    return gains


def _showcase(shown: Showcase) -> Iterator[Row]:
    group = f"The paper's method on the model of seed {SHOWCASE_SEED}"
    errors, near = np.array(shown.errors), flights_to_optimum(shown.errors)
    steps, flown = -np.diff(errors), float(near or len(errors))
    yield Row(
        group=group,
        label="flights until near the optimum",
        unit="flights",
        measured=flown,
        paper=float(PAPER_NEAR_OPTIMAL_AFTER),
        reference=PROTOTYPE_NEAR,
        ratio=flown / PAPER_NEAR_OPTIMAL_AFTER,
        digits=0,
        note=f"of {len(errors)} flown; the paper flew {PAPER_FLIGHTS}" if near else f"not within {len(errors)} flights",
    )
    yield Row(
        group=group,
        label="improvement of the first step, share of the total",
        unit="share",
        measured=float(steps[0] / (errors[0] - errors.min())),
        digits=2,
        note="the largest of all steps, as in the paper" if steps[0] == steps.max() else "not the largest step",
    )
    yield Row(
        group=group,
        label="error of the best flight over the optimum's",
        unit="×",
        measured=float(errors.min()) / BEST_ERROR,
        digits=3,
    )


def _starts(on_progress: Progress) -> Iterator[Row]:
    tell = counted(on_progress, len(EXPECTED_START) * SEEDS, _FROM_SHOWCASE, _FROM_STARTS)
    for perturbation, expected in EXPECTED_START.items():
        errors = []
        for seed in range(SEEDS):
            errors.extend(true_errors([start(perturbation, seed).gains]))
            tell(f"models' optima at ±{short_percent(perturbation)}, seed {seed}")
        yield Row(
            group=f"The model's optimum flown on the true model, median of {SEEDS} models",
            label=f"error over the optimum's at ±{short_percent(perturbation)}",
            unit="×",
            measured=float(np.median(errors)) / BEST_ERROR,
            reference=expected,
            digits=2,
        )


@dataclass(frozen=True, slots=True)
class _Comparison:
    """Methods over the same models, and the flight budget of each campaign."""

    perturbation: float
    methods: tuple[str, ...]
    max_flights: int
    rows: Callable[[MethodResult], Iterator[Row]]


def _methods(comparisons: Sequence[_Comparison], seeds: Sequence[int], on_progress: Progress) -> Iterator[Row]:
    total, flown = len(seeds) * sum(len(each.methods) for each in comparisons), count(1)
    tell = counted(on_progress, total, _FROM_STARTS)

    def on_campaign() -> None:
        tell(f"methods: {next(flown)} of {total} campaigns")

    for each in comparisons:
        for result in study(each.perturbation, seeds, each.methods, on_campaign, max_flights=each.max_flights):
            yield from each.rows(result)


def _method(found: MethodResult) -> Iterator[Row]:
    share, flights = (EXPECTED | EXPECTED_NOISY)[found.method.name]
    group = f"Methods over {len(found.campaigns)} models at ±{short_percent(found.perturbation)}"
    yield Row(
        group=group,
        label=f"{found.method.title}: near the optimum",
        unit="of models",
        measured=found.share,
        reference=share,
        digits=2,
        note=f"{len(found.flights)} of {len(found.campaigns)}",
    )
    if found.median_flights is not None:
        yield Row(
            group=group,
            label=f"{found.method.title}: median flights",
            unit="flights",
            measured=float(found.median_flights),
            reference=flights,
            digits=1,
            note="of those that reached it",
        )


def _by_the_second(found: MethodResult) -> Iterator[Row]:
    yield Row(
        group=f"{METHODS['identified'].title}: near the optimum by the second flight",
        label=f"{len(found.campaigns)} models at ±{short_percent(found.perturbation)}",
        unit="of models",
        measured=found.share_by(2),
        reference=AT_LEAST_SECOND,
        digits=2,
        note="should be at least the reference",
    )


_BRIEF: Final = (_Comparison(PERTURBATION, tuple(EXPECTED), MAX_FLIGHTS, _method),)
_FULL: Final = (
    *_BRIEF,
    _Comparison(PERTURBATION, tuple(EXPECTED_NOISY), NOISY_FLIGHTS, _method),
    *(_Comparison(perturbation, ("identified",), 2, _by_the_second) for perturbation in EXPECTED_START),
)


def _figures(shown: Showcase) -> dict[str, Plot]:
    first, best = shown.flights[0], shown.best
    errors = np.array(shown.errors)
    return {
        "figure2-left": _search_plot(np.array(shown.search_errors)),
        "figure2-right": _response_plot(
            "the model before and after", (("Hand gains", shown.model_hand), ("Model's optimum", shown.model_start))
        ),
        "figure3-left": _gains_plot(shown),
        "figure3-right": _errors_plot(errors),
        "figure4": _response_plot(
            "the first and the best flight",
            (("Model's optimum", first.trajectory), (f"Flight {best.number}, best", best.trajectory)),
        ),
    }


def _search_plot(errors: Vector) -> Plot:
    return Plot(
        title="the search on the model",
        summary=f"{len(errors)} iterations of Nelder–Mead take the inaccurate model's error from {errors[0]:.3f} to "
        f"{errors[-1]:.3f} rad·s.",
        x_title="Iteration",
        x_digits=0,
        panels=(
            Panel(
                y_title="Error (rad·s)",
                y_range=(0.0, float(1.1 * errors[0])),
                lines=(curve("Lowest so far", "after", np.arange(float(len(errors))), errors),),
            ),
        ),
    )


def _response_plot(title: str, runs: Sequence[tuple[str, Trajectory]]) -> Plot:
    """Pitch and its reference, one panel per run, with the error of all runs in a panel below."""
    styles: tuple[Style, ...] = ("before", "after")
    styled = tuple((name, run, style) for (name, run), style in zip(runs, styles, strict=True))
    pitch = tuple(
        Panel(
            y_title="Θ (°)",
            y_range=(-14.0, 14.0),
            digits=2,
            lines=(_degrees(name, style, run), _degrees("Reference", "goal", run, "pitch_reference_rad")),
        )
        for name, run, style in styled
    )
    off = Panel(
        y_title="Off (°)",
        digits=2,
        lines=tuple(_degrees(name, style, run, OUTPUT) for name, run, style in styled),
    )
    return Plot(
        title=title,
        summary="; ".join(f"{name}: error {truth().error(run):.4f} rad·s" for name, run in runs) + ".",
        x_title="Time (s)",
        x_range=(0.0, 60.0),
        panels=(*pitch, off),
    )


def _degrees(name: str, style: Style, run: Trajectory, channel: str = "pitch_rad") -> Line:
    return curve(name, style, run.time_s, np.rad2deg(run[channel]))


def _gains_plot(shown: Showcase) -> Plot:
    space, flown = PitchTracking.space, shown.flights
    numbers = np.arange(1.0, len(flown) + 1.0)
    return Plot(
        title="the gains of each flight",
        summary="The six gains, each in units of its scale, flight by flight.",
        x_title="Flight",
        x_digits=0,
        panels=(
            Panel(
                y_title="Gain, in its scale",
                lines=tuple(
                    curve(
                        f"θ{place}",
                        style,
                        numbers,
                        np.array([flight.gains[gain.name] / gain.scale for flight in flown]),
                        note=f"{gain.title}: scale {gain.scale:g} {gain.unit}",
                    )
                    for place, (gain, style) in enumerate(zip(space.gains, _STYLES, strict=True), start=1)
                ),
            ),
        ),
    )


def _errors_plot(errors: Vector) -> Plot:
    numbers = np.arange(1.0, len(errors) + 1.0)
    return Plot(
        title="the error of each flight",
        summary=f"The error falls from {errors[0]:.4f} to {errors.min():.4f} rad·s in {len(errors)} flights; the true "
        f"optimum within our bounds has {BEST_ERROR:.4f}.",
        x_title="Flight",
        x_digits=0,
        panels=(
            Panel(
                y_title="Error (rad·s)",
                digits=4,
                y_range=(0.0, float(1.1 * errors.max())),
                lines=(
                    curve("Optimum", "goal", np.array([1.0, numbers[-1]]), np.array([BEST_ERROR, BEST_ERROR])),
                    curve("Error", "after", numbers, errors),
                    marks("Flights", "run 1", numbers, errors),
                ),
            ),
        ),
    )
