"""Shares, medians and counts computed from the flights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Final

import numpy as np
from scipy.stats import binomtest

from bench.targets.flying import DEFAULT
from bench.targets.methods import METHODS
from bench.targets.results import OPTIMUM, Results, Task

TARGETS: Final = (0.05, 0.02)
AT_FLIGHTS: Final = (1, 2, 3, 5, 10, 20, 40)
_DEFAULT: Final = list(DEFAULT.values())


@dataclass(frozen=True, slots=True)
class Share:
    """A share of a total, with its Wilson 95 % interval."""

    count: int
    of: int

    @property
    def value(self) -> float:
        return self.count / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        if not self.of:
            return (float("nan"), float("nan"))
        found = binomtest(self.count, self.of).proportion_ci(confidence_level=0.95, method="wilson")
        return (float(found.low), float(found.high))

    def __str__(self) -> str:
        return self.rounded(0)

    def rounded(self, decimals: int) -> str:
        """Return the share as text with the given number of decimals: `85 % (79–90 %)`."""
        if not self.of:
            return "–"
        low, high = self.interval
        written = (f"{100.0 * share:.{decimals}f}" for share in (self.value, low, high))
        return "{} % ({}–{} %)".format(*written)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One method on one vehicle, flight by flight from the first: `excess` is how far the noise-free error of the
    recommended gains lies above the vehicle's own optimum, as a share of it; `counts` whether a flight counts as one
    on the way (not the first, not the default gains flown again); `settled` is the excess of the gains that a method
    ended with before its budget was spent, None when those are the last ones."""

    excess: tuple[float, ...]
    unsafe: tuple[bool, ...]
    counts: tuple[bool, ...]
    compute_s: tuple[float, ...]
    inside: tuple[bool, ...]
    ended: str
    budget: int
    settled: float | None = None

    def reached(self, target: float) -> int | None:
        """The first flight after which the recommended gains are within `target`."""
        return next((i for i, excess in enumerate(self.excess, 1) if excess <= target), None)

    def is_standing(self, target: float, flight: int) -> bool:
        """Whether the gains recommended after `flight`, or after the last one before, are within `target`."""
        if flight > len(self.excess) and self.settled is not None:
            return self.settled <= target
        return self.excess[min(flight, len(self.excess)) - 1] <= target

    def unsafe_on_the_way(self, target: float) -> int:
        """Unsafe flights until the target was reached, or all of them."""
        until = self.reached(target) or len(self.excess)
        return sum(unsafe and counts for unsafe, counts in zip(self.unsafe[:until], self.counts, strict=False))


@dataclass(frozen=True, slots=True)
class Outcome:
    """One method on one population."""

    courses: tuple[Course, ...]

    @property
    def budget(self) -> int:
        """Largest number of flights of a vehicle."""
        return max(course.budget for course in self.courses)

    def reached(self, target: float, flight: int) -> Share:
        hits = [course.reached(target) for course in self.courses]
        return Share(sum(hit is not None and hit <= flight for hit in hits), len(hits))

    def standing(self, target: float, flight: int) -> Share:
        return Share(sum(course.is_standing(target, flight) for course in self.courses), len(self.courses))

    def median_flights(self, target: float) -> str:
        """Return the median number of flights, or that it exceeds the budget."""
        hits = sorted(course.reached(target) or np.inf for course in self.courses)
        middle = median(hits)
        return f"{middle:g}" if np.isfinite(middle) else f"> {self.budget}"

    @property
    def unsafe_flights(self) -> Share:
        judged = [
            unsafe
            for course in self.courses
            for unsafe, counts in zip(course.unsafe, course.counts, strict=True)
            if counts
        ]
        return Share(sum(judged), len(judged))

    @property
    def unsafe_starts(self) -> Share:
        """Unsafe first flights."""
        return Share(sum(course.unsafe[0] for course in self.courses), len(self.courses))

    def unsafe_on_the_way(self, target: float) -> float:
        """Unsafe flights per vehicle until the target is reached."""
        return float(np.mean([course.unsafe_on_the_way(target) for course in self.courses]))

    @property
    def refused(self) -> int:
        return sum(course.ended.startswith("refused") for course in self.courses)

    @property
    def coverage(self) -> Share:
        """Flights inside their predicted intervals."""
        inside = [each for course in self.courses for each in course.inside]
        return Share(sum(inside), len(inside))

    @property
    def compute_s(self) -> tuple[float, float]:
        """Median and largest time of choosing a flight."""
        times = [seconds for course in self.courses for seconds in course.compute_s[1:]]
        return (float(np.median(times)), max(times)) if times else (float("nan"), float("nan"))


def outcomes(results: Results, population: str, seed: int) -> dict[str, Outcome]:
    """Return every method with results for this population, in the order of the registry."""
    found: dict[str, Outcome] = {}
    for method in METHODS:
        tasks = [task for task in results if (task.population, task.seed, task.what) == (population, seed, method)]
        courses = [
            course
            for task in sorted(tasks, key=lambda task: task.number)
            if (course := _course(results, task)) is not None
        ]
        if courses:
            found[method] = Outcome(tuple(courses))
    return found


def _course(results: Results, task: Task) -> Course | None:
    own = Task(population=task.population, number=task.number, seed=task.seed, what=OPTIMUM)
    if task.population == "twin":
        own = Task(population="twin", number=1, seed=task.seed, what=OPTIMUM)  # all are the same vehicle
    if own not in results:
        return None
    best, record = _number(results[own]["error"]), results[task]
    flights, budget, settled = record["flights"], record["budget"], record.get("settled_error")
    assert isinstance(flights, Sequence)
    assert isinstance(budget, int)
    course = course_of(flights, best=best, ended=str(record["ended"]), budget=budget)
    return course if settled is None else replace(course, settled=_number(settled) / best - 1.0)


def course_of(flights: Sequence[Mapping[str, object]], *, best: float, ended: str, budget: int) -> Course:
    """Return the course of stored flights; `best` is the error of the vehicle's own optimum, m."""
    return Course(
        excess=tuple(_number(flight["chosen_error"]) / best - 1.0 for flight in flights),
        unsafe=tuple(bool(flight["is_unsafe"]) for flight in flights),
        counts=tuple(i > 0 and list(_numbers(flight["gains"])) != _DEFAULT for i, flight in enumerate(flights)),
        compute_s=tuple(_number(flight["compute_s"]) for flight in flights),
        inside=tuple(
            interval[0] <= _number(flight["error"]) <= interval[1]
            for flight in flights[1:]
            if (interval := _numbers(flight["interval"]))
        ),
        ended=ended,
        budget=budget,
    )


def _number(value: object) -> float:
    assert isinstance(value, int | float)
    return float(value)


def _numbers(values: object) -> tuple[float, ...]:
    if values is None:
        return ()
    assert isinstance(values, Sequence)
    return tuple(_number(value) for value in values)
