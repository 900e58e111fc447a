"""The paper's method flown as campaigns, and the steps between runs, ours beside those of the paper.

A campaign flies the strategy `gradient` with raw gains and the bias outside the loop until the stop rule `paper` ends
it. It starts from the default gains or from the optimum that Nelder–Mead finds on the model within the bounds of a
campaign, which exclude the paper's own (ki = 1356).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Final

import numpy as np

from app.core.definition import Definition, Flight, Start, StopRule
from app.core.experiments.takeoff import Takeoff
from app.core.formatting import count
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory
from app.core.tuning.corrected_model import uncorrected_model
from app.core.tuning.evidence import Evidence
from app.core.tuning.gate import check_policy, require_flyable
from app.core.tuning.proposals import next_proposal
from app.core.tuning.stop_rules import evaluate_stop_rule
from app.reproductions.results import Row

_TAKEOFF: Final = Takeoff()
_RAW: Final = Definition(options={"scaled": False, "bias": "outside"}, stop=StopRule(kind="paper"))
CAMPAIGNS: Final[Mapping[str, Definition]] = {
    "from the default gains": _RAW,
    "from the simplex's gains": replace(_RAW, start=Start(kind="simplex")),
    "from the default gains, diminishing step size": replace(_RAW, options=_RAW.options | {"step_size": "diminishing"}),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
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
        change = "/".join(f"{value:+.0f}" if value else "0" for value in self.change).replace("-", "−")
        shorter = "" if self.shortened is None else f", {self.shortened:.2f} of the step before"
        return f"{change} from run {self.base}, {self.length:.0f} long{shorter}"


def step_numbers(step: Step | None, whose: str = "") -> dict[str, float]:
    """The step for `Row.numbers`, each name preceded by `whose`."""
    if step is None:
        return {}
    change = {f"step_{name}_counts": value for name, value in zip(_TAKEOFF.space.names, step.change, strict=True)}
    numbers = {**change, "step_length_counts": step.length, "shortened": step.shortened}
    return {whose + name: value for name, value in numbers.items() if value is not None}


@dataclass(frozen=True, slots=True)
class Run:
    """One flight of a campaign, ours or the paper's: gains in counts, error in m, and the step to it; None for the
    first."""

    gains: tuple[float, ...]
    error: float
    step: Step | None


def runs_of(flown: Iterable[tuple[Sequence[float], float]]) -> tuple[Run, ...]:
    """The runs with these gains and errors."""
    runs: list[Run] = []
    for gains, error in flown:
        runs.append(Run(tuple(gains), error, _step_to(gains, runs) if runs else None))
    return tuple(runs)


def _step_to(gains: Sequence[float], earlier: Sequence[Run]) -> Step:
    base = min(range(len(earlier)), key=lambda place: earlier[place].error)
    change, last = np.subtract(gains, earlier[base].gains), earlier[-1].step
    length = float(np.linalg.norm(change))
    shortened = length / last.length if last is not None and last.base == base + 1 else None
    return Step(base + 1, tuple(change.tolist()), length, shortened)


def gains_text(gains: Iterable[float]) -> str:
    """`283, 13, 82`."""
    return ", ".join(f"{gain:g}" for gain in gains)


@dataclass(frozen=True, slots=True)
class Campaign:
    """A campaign flown until its rule stopped it, with the reason, beside the paper's runs from the same kind of
    start."""

    title: str
    runs: tuple[Run, ...]
    published: tuple[Run, ...]
    reason: str

    def __str__(self) -> str:
        """`from the default gains 0.0931 m in 6 flights (not improving), published 0.1521 m in 5`."""
        published = f"published {least(self.published):.4f} m in {len(self.published)}"
        flown = f"{count(len(self.runs), 'flight')} ({self.reason})"
        return f"{self.title} {least(self.runs):.4f} m in {flown}, {published}"

    def rows(self, kind: str) -> Iterator[Row]:
        """A row for each flight, beside the paper's run of the same number."""
        for number, (run, paper) in enumerate(zip_longest(self.runs, self.published[: len(self.runs)]), start=1):
            theirs = paper.step if paper else None
            yield Row(
                group=f"Campaign on {kind} {self.title}",
                label=f"run {number}: {gains_text(run.gains)}",
                unit="m",
                measured=run.error,
                paper=paper.error if paper else None,
                ratio=run.error / paper.error if paper else None,
                note=(f"step {run.step}" if run.step else "") + (f"; published {theirs}" if theirs else ""),
                gains=dict(zip(_TAKEOFF.space.names, run.gains, strict=True)),
                numbers=step_numbers(run.step) | step_numbers(theirs, "paper_"),
            )


def least(runs: Iterable[Run]) -> float:
    """The lowest error, m."""
    return min(run.error for run in runs)


def fly_campaign(title: str, published: tuple[Run, ...], fly: Callable[[Gains], Trajectory]) -> Campaign:
    """Fly one of `CAMPAIGNS` until its rule stops it; `fly` returns the record of a flight with the given gains.

    Raises GainsError if the gate refuses a proposal.
    """
    definition = CAMPAIGNS[title]
    flights: list[Flight] = []
    while True:
        evidence = Evidence(definition=definition, experiment=_TAKEOFF, flights=flights)
        proposal = next_proposal(evidence)
        verdict = evaluate_stop_rule(evidence, proposal)
        if verdict.reason is not None:
            break
        gains, spread = proposal.gains, proposal.spread
        require_flyable(check_policy(evidence, gains, start=gains, spread=spread))
        flights.append(_TAKEOFF.scored_flight(len(flights) + 1, gains, fly(gains).as_stored()))
    runs = runs_of((tuple(flight.gains.values()), flight.error or 0.0) for flight in flights)
    return Campaign(title, runs, published, verdict.reason)


def campaign_notes(default: Campaign, simplex: Campaign, diminishing: Campaign) -> Iterator[str]:
    """How the campaigns of `CAMPAIGNS` differ from the published ones."""
    pairs = zip(default.runs, default.published, strict=False)
    first, *longer = [ours.step.length / paper.step.length for ours, paper in pairs if ours.step and paper.step]
    steps = [run.step for run in (*default.published, *simplex.published) if run.step]
    shortened = " and ".join(f"{step.shortened:.2f}" for step in steps if step.shortened)
    lengths = ", ".join(f"{run.step.length:.0f}" for run in diminishing.runs if run.step)
    start, paper = simplex.runs[0].gains, simplex.published[0].gains
    own, theirs = uncorrected_model(_TAKEOFF).errors(np.array([start, paper]))
    yield (
        f"The first step from the default gains has the direction of the published one, but is {first:.1f} times as "
        f"long, the later ones {min(longer):.1f} to {max(longer):.0f} times: each search starts with all step sizes "
        "again, however short the last step was. The paper does not publish its step sizes. "
        f"Best error {default}; {simplex}. Every flight improves on the best before it: published runs that fail, such "
        f"as run 4 from the default gains, and the published plateau at {least(default.published):.2f} m do not appear."
    )
    yield (
        f"With step_size = diminishing (footnote 3 of the paper) the steps are {lengths} long. Best error "
        f"{diminishing}. The option does not limit the first step, the only one if any from the simplex's gains. A "
        f"step that does not improve is followed by one half as long; in the paper by one {shortened} as long."
    )
    yield (
        f"The simplex search ends at {gains_text(start)}, with {own:.4f} m on the model, on which the published "
        f"{gains_text(paper)} have {theirs:.4f} m: in so flat a valley its end depends on its first steps and the "
        f"bounds (ki at most {_TAKEOFF.space.upper[1]:g}). The paper publishes neither, nor its model's mass."
    )
