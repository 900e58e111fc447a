"""What the tunings by altitude steps give, as tables and as a section of a document."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from bench.targets.methods import METHODS
from bench.targets.report import Share
from bench.targets.results import Results, Task

AT_FLIGHTS: Final = (2, 3, 5, 10, 20, 40)
_COMPARED: Final = "For comparison: "
NEAR: Final = 1.1
"""Error, of the best, up to which gains count as near it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One method on one vehicle: the error to expect with the gains recommended after each flight, m, that of the best
    gains, which flights ring, and whether the last recommended gains ring or lack the margin of a proposal."""

    expected_m: tuple[float, ...]
    best_m: float
    rings: tuple[bool, ...]
    ends_ringing: bool
    ends_without_margin: bool

    def after(self, flight: int) -> float:
        """The error to expect after so many flights, or the last before, m."""
        return self.expected_m[min(flight, len(self.expected_m)) - 1]


@dataclass(frozen=True, slots=True)
class Outcome:
    """One method on all vehicles; `flights` is the largest number that it flew, 0 of a set that needs none."""

    flights: int
    courses: tuple[Course, ...]

    def errors_m(self, flight: int) -> np.ndarray:
        """Errors to expect after so many flights, shape (k,)."""
        return np.array([course.after(flight) for course in self.courses])

    def near(self, flight: int) -> Share:
        """Vehicles whose recommended gains are within 10 % of the best."""
        near = [course.after(flight) <= NEAR * course.best_m for course in self.courses]
        return Share(sum(near), len(near))

    @property
    def ringing(self) -> Share:
        """Flights after the first that ring."""
        rings = [each for course in self.courses for each in course.rings[1:]]
        return Share(sum(rings), len(rings))

    @property
    def ends_ringing(self) -> int:
        return sum(course.ends_ringing for course in self.courses)

    @property
    def ends_without_margin(self) -> int:
        return sum(course.ends_without_margin for course in self.courses)


def outcomes(results: Results, tasks: Sequence[Task]) -> dict[str, dict[str, Outcome]]:
    """The outcomes of these tasks that are in the results, by autopilot and title, in the order of the tasks."""
    courses: dict[str, dict[str, list[Course]]] = defaultdict(lambda: defaultdict(list))
    budgets: dict[str, int] = defaultdict(int)
    done = [task for task in tasks if task in results]
    best_m = {(task.population, task.number): _number(results[task]) for task in done if task.what == "best"}
    for task in done:
        key, record = (task.population, task.number), dict(results[task])
        if task.what == "best" or key not in best_m:
            continue
        for name, flights in _flights(task.what, record).items():
            last = flights[-1]["recommended"]
            budgets[name] = max(budgets[name], len(flights) if task.what in METHODS else 0)
            courses[task.population][name].append(
                Course(
                    expected_m=tuple(each["recommended"]["expected"] for each in flights),
                    best_m=best_m[key],
                    rings=tuple(each["rings"] for each in flights),
                    ends_ringing=last["rings"],
                    ends_without_margin=last["lacks_margin"],
                )
            )
    order = (*METHODS, *(name for name in budgets if name not in METHODS))
    return {
        autopilot: {name: Outcome(budgets[name], tuple(found[name])) for name in order if name in found}
        for autopilot, found in courses.items()
    }


def _number(record: Mapping[str, Any]) -> float:
    return float(record["expected"])


def _flights(what: str, record: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """The flights of a method; of rules, each by its name, as one flight that recommends itself."""
    if what in METHODS:
        return {what: record["flights"]}
    return {name: [{"recommended": judged, "rings": judged["rings"]}] for name, judged in record["rules"].items()}


def tables(found: Mapping[str, Outcome]) -> list[str]:
    """Errors by the number of flights, shares near the best, and what rings."""
    at = [f"flight {number}" for number in AT_FLIGHTS]
    errors = [["method", "vehicles", "flights", *at, "95 % of the vehicles below"]]
    shares = [["method", *at, "flights that ring", "end with ringing gains", "end without the margin"]]
    for name, outcome in found.items():
        title = METHODS[name].title if name in METHODS else name.removeprefix(_COMPARED)
        count = len(outcome.courses)
        ends = outcome.errors_m(AT_FLIGHTS[-1])
        medians = [_mm(float(np.median(outcome.errors_m(number)))) for number in AT_FLIGHTS]
        flights = str(outcome.flights) if outcome.flights else "none"
        errors.append([title, str(count), flights, *medians, _mm(float(np.quantile(ends, 0.95)))])
        near = [str(outcome.near(number)) for number in AT_FLIGHTS]
        rings = outcome.ringing.rounded(1) if outcome.flights else "–"
        shares.append([title, *near, rings, str(outcome.ends_ringing), str(outcome.ends_without_margin)])
    best_m = [course.best_m for course in next(iter(found.values())).courses]
    own = f"Best of the grid: median {_mm(float(np.median(best_m)))}, of {len(best_m)} vehicles."
    return [*_table(errors), "", *_table(shares), "", own]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    head, *body = [f"| {' | '.join(row)} |" for row in rows]
    return [head, f"| {' | '.join(['---'] * len(rows[0]))} |", *body]


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm"


HEADING: Final = "## Altitude steps under ArduCopter and PX4"
_INTRODUCTION: Final = f"""\
{HEADING}

The number of flights of altitude steps until the error with the recommended gains is near that of the best ones, of
random multicopters with more physics than the model (a thrust polynomial, falling battery, quadratic drag, dead time,
gusts, an estimator that wanders: `bench/copters/simulation.py`).

- Every method begins with the firmware's default gains, and flies the same vehicles in the same weather. Black-box
  methods search the documented ranges in which Gainline proposes, and know the error of single flights.
- The error compared is the mean of four further flights with the recommended gains, in other weather, the same for all
  gains of a vehicle: gusts and noise are in it. Gainline recommends the gains that it proposed last, the other methods
  the best that they have flown.
- *Best* is the best of a grid of 324 (ArduCopter) or 252 (PX4) gain sets that keep the limits of a proposal on the
  vehicle itself: the margin from ringing, and 1.5 times the throttle activity of the default gains. Only Gainline keeps
  these limits, so other methods may end below the best, without margin.
- A flight rings if an oscillation of the vehicle's own linear model has a damping ratio below 0.05. The margin is that
  of a proposal: no ringing with 30 ms more lag and up to twice the fast gains.
- The sets below the methods are flown without a search, so that their figures are the same after any number of flights:
  the firmware's defaults, the rule of ArduCopter's documentation, and sets that are common.
- Gainline's proposals pass its gate. A method that ends early, or has fewer flights than the number in the column, is
  counted with its last recommendation. Methods with slow proposals tuned fewer vehicles, the first ones, so that only
  their shares compare with those of the others, not their errors.

To regenerate this section (`--results FILE` can be interrupted and continued):

    ./dev exec uv pip install --require-hashes -r requirements/bench.txt
    ./dev exec python -m bench.steps_to_target --vehicles 200 --methods all --seed {{seed}} --out docs

Seed {{seed}}. All of this is simulated; no real vehicle has flown it."""


def section(found: Mapping[str, Mapping[str, Outcome]], seed: int) -> str:
    """The section in Markdown."""
    lines = [_INTRODUCTION.format(seed=seed)]
    for autopilot, each in found.items():
        lines += ["", f"### {autopilot}", "", *tables(each)]
    return "\n".join([*lines, ""])
