"""The paper's method flown as campaigns, and the steps between runs, ours beside those of the paper.

A campaign flies the strategy `gradient` with raw gains and the bias outside the loop until the stop rule `paper` ends
it. It starts from the default gains or from the optimum that Nelder–Mead finds on the model within the bounds of a
campaign, which exclude the paper's own (ki = 1356).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from app.core.definition import Definition, Flight, Start, StopRule
from app.core.experiments.takeoff import Takeoff
from app.core.formatting import count, number
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory
from app.core.tuning.corrected_model import uncorrected_model
from app.core.tuning.gate import check_policy, require_flyable
from app.core.tuning.proposals import next_proposal
from app.core.tuning.stop_rules import evaluate_stop_rule
from app.reproductions.results import OVERRULE, Row, ratio

_TAKEOFF: Final = Takeoff()
_METHOD: Final = Definition(
    strategy="gradient", options={"scaled": False, "bias": "outside"}, stop=StopRule(kind="paper")
)
_SIMPLEX: Final = Start(kind="simplex")
_DIMINISHING: Final = {**_METHOD.options, "step_size": "diminishing"}
CAMPAIGNS: Final[Mapping[str, Definition]] = MappingProxyType({
    "from the default gains": _METHOD,
    "from the simplex's gains": replace(_METHOD, start=_SIMPLEX),
    "from the default gains, diminishing step size": replace(_METHOD, options=_DIMINISHING),
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Run:
    """One flight of a campaign, ours or the paper's: gains in counts, and the error in m."""

    gains: tuple[float, ...]
    error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """The change of each gain from the best run before, number `base`, and its Euclidean length, both in counts.

    `shortened` is the length over that of the step before, if that one did not improve on the same base.
    """

    base: int
    change: tuple[float, ...]
    length: float
    shortened: float | None

    def __str__(self) -> str:
        """`+213/+75/−40 from run 3, 229 long`."""
        shorter = "" if self.shortened is None else f", {self.shortened:.2f} of the step before"
        return f"{direction_text(self.change)} from run {self.base}, {self.length:.0f} long{shorter}"


def direction_text(change: Sequence[float]) -> str:
    """`+3/+79/0`."""
    return "/".join(f"{value:+.0f}" if value else "0" for value in change).replace("-", "−")


def steps_between(runs: Sequence[Run]) -> tuple[Step, ...]:
    """The step to every run after the first."""
    steps: list[Step] = []
    for place in range(1, len(runs)):
        base = min(range(place), key=lambda earlier: runs[earlier].error)
        change = np.subtract(runs[place].gains, runs[base].gains)
        length = float(np.linalg.norm(change))
        shortened = length / steps[-1].length if steps and steps[-1].base == base + 1 else None
        steps.append(Step(base=base + 1, change=tuple(change.tolist()), length=length, shortened=shortened))
    return tuple(steps)


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """A campaign flown to its end, beside the paper's runs from the same kind of start. `why` says why it ended;
    `overruled` has, for each run, the reason for flying it although the gate refuses it."""

    title: str
    runs: tuple[Run, ...]
    published: tuple[Run, ...]
    overruled: tuple[str, ...]
    why: str

    @property
    def best(self) -> float:
        return min(run.error for run in self.runs)

    @property
    def steps(self) -> tuple[Step, ...]:
        return steps_between(self.runs)


def fly_campaign(
    title: str, definition: Definition, published: Sequence[Run], fly: Callable[[Gains], Trajectory]
) -> Campaign:
    """Fly a simulated campaign until its rule stops it; `fly` returns the record of a flight with the given gains."""
    flights: list[Flight] = []
    runs: list[Run] = []
    overruled: list[str] = []
    while True:
        proposal = next_proposal(definition, flights)
        verdict = evaluate_stop_rule(definition, flights, proposal)
        if verdict.stop:
            return Campaign(
                title=title,
                runs=tuple(runs),
                published=tuple(published),
                overruled=tuple(overruled),
                why=verdict.why,
            )
        gate = check_policy(
            definition, _TAKEOFF, _TAKEOFF.space, proposal.gains, flights, start=proposal.gains, spread=proposal.spread
        )
        overruled.append(require_flyable(gate, overrule=OVERRULE))
        record = fly(proposal.gains).as_stored()
        error = _TAKEOFF.error(record)
        flights.append(
            Flight(number=len(flights) + 1, gains=proposal.gains, trajectory=record, error=error, outcome="valid")
        )
        runs.append(Run(tuple(proposal.gains.values()), error))


def campaign_rows(kind: str, flown: Campaign) -> Iterator[Row]:
    """A row for each flight, beside the paper's run of the same number, and one for the best."""
    group = f"Campaign on {kind} {flown.title}"
    steps, theirs = (None, *flown.steps), (None, *steps_between(flown.published))
    for place, (run, step, overruled) in enumerate(zip(flown.runs, steps, flown.overruled, strict=True)):
        paper = flown.published[place] if place < len(flown.published) else None
        their = theirs[place] if place < len(theirs) else None
        beside = "" if their is None else f"; published {direction_text(their.change)}, {their.length:.0f} long"
        yield Row(
            group=group,
            label=f"run {place + 1}: {', '.join(f'{gain:g}' for gain in run.gains)}",
            unit="m",
            measured=run.error,
            paper=None if paper is None else paper.error,
            ratio=None if paper is None else ratio(run.error, paper.error),
            note="" if step is None else f"{step}{beside}",
            gains=dict(zip(_TAKEOFF.space.names, run.gains, strict=True)),
            numbers={**step_numbers(step), **{f"paper_{name}": value for name, value in step_numbers(their).items()}},
            overruled=overruled,
        )
    best = min(run.error for run in flown.published)
    yield Row(
        group=group,
        label=f"best of {count(len(flown.runs), 'run')}",
        unit="m",
        measured=flown.best,
        paper=best,
        ratio=ratio(flown.best, best),
        note=f"published: best of {len(flown.published)}; ended here because: {flown.why}",
        numbers={"runs": float(len(flown.runs)), "paper_runs": float(len(flown.published))},
    )


def step_numbers(step: Step | None) -> dict[str, float]:
    """The step as numbers of a row."""
    if step is None:
        return {}
    change = {f"step_{name}_counts": value for name, value in zip(_TAKEOFF.space.names, step.change, strict=True)}
    shortened = {} if step.shortened is None else {"shortened": step.shortened}
    return {**change, "step_length_counts": step.length, "step_from_run": float(step.base), **shortened}


def campaign_notes(default: Campaign, simplex: Campaign, diminishing: Campaign) -> Iterator[str]:
    """How the campaigns of `CAMPAIGNS` differ from the published ones."""
    ours, theirs = default.steps, steps_between(default.published)
    cosine = np.dot(ours[0].change, theirs[0].change) / (ours[0].length * theirs[0].length)
    longer = [step.length / published.length for step, published in zip(ours, theirs, strict=False)]
    yield (
        f"The first step from the default gains, {direction_text(ours[0].change)}, agrees with the published "
        f"{direction_text(theirs[0].change)} in direction, to {np.degrees(np.arccos(min(cosine, 1.0))):.1f}°, but is "
        f"{longer[0]:.1f} times as long. The later steps are {min(longer[1:]):.1f} to {max(longer[1:]):.0f} times as "
        "long as the published ones: each search starts with all step sizes again, however short the last step was. "
        "The paper does not publish its step sizes."
    )
    reached = "; ".join(
        f"{flown.title} {number(flown.best, 4)} m in {count(len(flown.runs), 'flight')}, published "
        f"{number(min(run.error for run in flown.published), 4)} m in {len(flown.published)}"
        for flown in (default, simplex)
    )
    yield (
        f"Best error {reached}. Every flight of these campaigns improves on the best before it: the published runs "
        f"that do not ({_failed(default.published)} and {_failed(simplex.published)}) have no counterpart, nor has the "
        f"published plateau at {min(run.error for run in default.published):.2f} m."
    )
    lengths = ", ".join(f"{step.length:.0f}" for step in diminishing.steps)
    yield (
        "With the strategy's option step_size = diminishing (successful step k is at most (k − 1)/k as long as the one "
        f"before, see the paper's footnote 3) the steps from the default gains are {lengths} long, and the best error "
        f"is {number(diminishing.best, 4)} m in {count(len(diminishing.runs), 'flight')}. From the simplex's gains it "
        "makes no difference, because at most one step is flown. A step that does not improve is followed by one half "
        f"as long; in the paper by one {' and '.join(_shortened(default.published, simplex.published))} as long."
    )
    start, paper = simplex.runs[0].gains, simplex.published[0].gains
    own, published = uncorrected_model(_TAKEOFF).errors(np.array([start, paper]))
    yield (
        f"The simplex search ends here at {_gains(start)}, with {own:.4f} m on the model, on which the published "
        f"{_gains(paper)} have {published:.4f} m. The valley is so flat that its first gains, its first steps and the "
        "bounds decide where the search ends; the paper publishes none of these, nor its model's mass. A campaign here "
        f"cannot start from the published gains, because ki is at most {_TAKEOFF.space.upper[1]:g}."
    )


def _failed(runs: Sequence[Run]) -> str:
    failed = [place + 1 for place in range(1, len(runs)) if runs[place].error >= min(run.error for run in runs[:place])]
    return f"{'runs' if len(failed) > 1 else 'run'} {', '.join(map(str, failed))} of {len(runs)}"


def _shortened(*series: Sequence[Run]) -> list[str]:
    return [f"{step.shortened:.2f}" for runs in series for step in steps_between(runs) if step.shortened is not None]


def _gains(gains: Sequence[float]) -> str:
    return ", ".join(f"{gain:g}" for gain in gains)
