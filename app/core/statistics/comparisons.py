"""Statistics of repeated flights: means with standard errors, comparisons, drift, trends.

The errors of one policy are assumed normal around its true error, with a scatter σ common to all policies. The
experiment's prior scatter s₀ counts as ν₀ degrees of freedom (a scaled inverse χ², Gelman et al., Bayesian Data
Analysis, 3rd ed., sections 2.6 and 3.3). With the repeats of all groups

    σ̂² = (ν₀ s₀² + Σ (e − ē)²) / ν,    ν = ν₀ + Σ (n − 1),

and the difference of two means is t-distributed with ν degrees of freedom around the observed one, with the standard
error σ̂ √(1/n₁ + 1/n₂): the pooled t test if ν₀ = 0.

A prior that was not measured on such a vehicle is left out: σ̂ is then estimated from the repeats alone. Without
repeats the scatter is not known yet, and no difference can be distinguished from noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Final, Literal

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Matrix, Scatter
from app.core.formatting import confidence_text, count
from app.core.policy import Gains, Vector

Verdict = Literal["better", "worse", "unresolved", "not known yet"]
"""`unresolved`: the flights do not decide the comparison; `not known yet`: the scatter is unknown."""

SCATTER_NOT_KNOWN: Final = (
    "The flight-to-flight scatter under this autopilot is unknown, so the difference cannot be tested. Fly one of "
    "the gain sets again."
)

MAX_FURTHER_FLIGHTS: Final = 100
_OPTIMISM_POINTS: Final = 2001
_OPTIMISM_REACH: Final = 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PooledScatter:
    """Flight-to-flight scatter: a standard deviation in the error's unit, and its degrees of freedom.

    A scatter that is not `known` is an order of magnitude: it may be used to rank policies, but is never reported.
    Neither is one whose repeats were all `identical`, as those of a simulation without scatter are: it is the prior's.
    """

    sigma: float
    degrees_of_freedom: float
    known: bool = True
    identical: bool = False

    @property
    def reported(self) -> float | None:
        """The standard deviation of one flight; None if it is not known or there is none."""
        return self.sigma if self.known and not self.identical else None

    def half_width(self, variance: float, confidence: float) -> float:
        """Half width of the two-sided interval of a quantity with variance `variance`·σ²."""
        from scipy.special import stdtrit

        return float(stdtrit(self.degrees_of_freedom, 0.5 + confidence / 2)) * self.sigma * float(np.sqrt(variance))


@dataclass(frozen=True)
class Group:
    """The valid flights of one policy, in order."""

    gains: Gains
    numbers: tuple[int, ...]
    errors: tuple[float, ...]

    @property
    def size(self) -> int:
        return len(self.errors)

    @cached_property
    def mean(self) -> float:
        return self.errors[0] if len(set(self.errors)) == 1 else float(np.mean(self.errors))

    @property
    def squares(self) -> float:
        """Σ (e − ē)², with size − 1 degrees of freedom."""
        if self.size == 1:
            return 0.0
        return float(np.sum((np.array(self.errors) - self.mean) ** 2))

    def standard_error(self, scatter: PooledScatter) -> float:
        return scatter.sigma / sqrt(self.size)

    def pessimistic(self, scatter: PooledScatter) -> float:
        """Mean plus standard error, by which policies are ranked."""
        return self.mean + self.standard_error(scatter)

    def known_error(self, scatter: PooledScatter) -> float | None:
        """The standard error; None while the scatter is not known, and if there is none."""
        return None if scatter.reported is None else self.standard_error(scatter)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightsToDecide:
    """Further flights of each of two policies that decide the comparison, if the difference stays the same."""

    first: int
    second: int

    @property
    def total(self) -> int:
        return self.first + self.second


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Whether the first of two policies is better (has a lower error) than the second.

    `difference` is first − second. `confidence` is that of the likelier direction, corrected for the choice among
    policies and for earlier comparisons. `further` is None for a decided comparison, for one that 100 flights would not
    decide, and if it was not requested. While the scatter is not known, there is neither a confidence nor a standard
    error; any repeat of gains already flown makes it known.
    """

    verdict: Verdict
    confidence: float | None
    difference: float
    standard_error: float | None
    further: FlightsToDecide | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Change of the error of the same gains from flight `first_number` to `last_number`: `confidence` that it has
    changed at all."""

    first_number: int
    last_number: int
    difference: float
    standard_error: float
    confidence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Trend:
    """A least squares line, error = level + slope·x; `lower` … `upper` is the slope's interval with `confidence`."""

    slope: float
    standard_error: float
    lower: float
    upper: float
    confidence: float

    @property
    def is_resolved(self) -> bool:
        """Whether the interval excludes zero."""
        return self.lower > 0.0 or self.upper < 0.0


def groups_of(flights: Sequence[Flight]) -> tuple[Group, ...]:
    """Group the valid flights by their gains, in the order of each policy's first flight."""
    found: dict[tuple[tuple[str, float], ...], list[Flight]] = {}
    for flight in flights:
        if flight.outcome == "valid" and flight.error is not None:
            found.setdefault(tuple(sorted(flight.gains.items())), []).append(flight)
    return tuple(
        Group(
            gains=dict(same[0].gains),
            numbers=tuple(flight.number for flight in same),
            errors=tuple(flight.error for flight in same if flight.error is not None),
        )
        for same in found.values()
    )


def pool_scatter(groups: Sequence[Group], prior: Scatter) -> PooledScatter:
    """σ̂ and ν as above. Either `prior.degrees_of_freedom` must be above zero or a policy must have been repeated."""
    repeats = sum(group.size - 1 for group in groups)
    if not prior.measured and not repeats:
        return PooledScatter(sigma=prior.sd, degrees_of_freedom=prior.degrees_of_freedom, known=False)
    worth = prior.degrees_of_freedom if prior.measured else 0.0
    freedom = worth + repeats
    squares = worth * prior.sd**2 + sum(group.squares for group in groups)
    identical = repeats > 0 and all(group.squares == 0.0 for group in groups)
    return PooledScatter(sigma=float(np.sqrt(squares / freedom)), degrees_of_freedom=freedom, identical=identical)


def select_winner(groups: Sequence[Group], scatter: PooledScatter) -> Group:
    """The policy with the lowest mean plus one standard error, the earliest of equals.

    A single lucky flight thus does not overtake a policy that has repeated the same error. There must be at least one
    group.
    """
    return min(groups, key=lambda group: (group.pessimistic(scatter), group.numbers[0]))


def compare(
    first: Group,
    second: Group,
    scatter: PooledScatter,
    confidence: float,
    *,
    candidates: int = 1,
    looks: int = 0,
    plan_further: bool = True,
) -> Comparison:
    """Compare two means by Student's t test.

    `candidates` is the number of policies from which `first` was chosen for its low error; the error probability is
    multiplied by it (Bonferroni), so that the best of N gets no credit for having been chosen. `looks` is the number of
    comparisons of growing data so far; at the k-th the error probability is multiplied by k(k + 1). As Σ 1/(k(k + 1)) =
    1, the probability of ever reaching a wrong verdict stays below 1 − confidence. `plan_further` also computes how
    many `further` flights would decide, which takes most of the time.
    """
    allowance = candidates * max(looks * (looks + 1), 1)
    difference = first.mean - second.mean
    if not scatter.known:
        return Comparison(
            verdict="not known yet", confidence=None, difference=difference, standard_error=None, further=None
        )
    standard_error = _standard_error(scatter, (first.size, second.size))
    certainty = _certainty(difference, standard_error, scatter.degrees_of_freedom, allowance)
    verdict: Verdict = "unresolved" if certainty < confidence else "better" if difference < 0.0 else "worse"
    return Comparison(
        verdict=verdict,
        confidence=certainty,
        difference=difference,
        standard_error=standard_error,
        further=_further(first, second, scatter, confidence, candidates, looks)
        if plan_further and verdict == "unresolved"
        else None,
    )


def optimism(means: Sequence[float], standard_errors: Sequence[float]) -> float:
    """Expected selection bias of the best of several noisy means.

    E[true − observed] of the lowest, if the observed means were the true ones and were observed again with these
    (positive) standard errors. For N equal means it is the expected minimum of N normal errors, 0.56 σ for two and 1.16
    σ for five; means far above the lowest add nothing. Numerical integral, to 1e-6 of the largest standard error.
    """
    from scipy.integrate import trapezoid
    from scipy.special import ndtr

    centre, sd = np.array(means), np.array(standard_errors)
    if not (sd > 0.0).all():
        return 0.0
    low, high = centre.min() - _OPTIMISM_REACH * sd.max(), centre.min() + _OPTIMISM_REACH * sd.max()
    near = centre - _OPTIMISM_REACH * sd <= high
    centre, sd = centre[near], sd[near]
    observed = np.linspace(low, high, _OPTIMISM_POINTS)
    away = (observed - centre[:, np.newaxis]) / sd[:, np.newaxis]
    density = np.exp(-0.5 * away**2) / np.sqrt(2.0 * np.pi) / sd[:, np.newaxis]
    shifted = (centre[:, np.newaxis] - observed) * density * _products_of_others(ndtr(-away))
    return float(trapezoid(shifted.sum(axis=0), observed))


def _products_of_others(factors: Matrix) -> Matrix:
    """Row i holds the product of all rows of `factors` but the i-th, both (n, k); without division, as some are 0."""
    before, after = np.ones_like(factors), np.ones_like(factors)
    np.cumprod(factors[:-1], axis=0, out=before[1:])
    np.cumprod(factors[:0:-1], axis=0, out=after[-2::-1])
    return before * after


def drift_of(groups: Sequence[Group], scatter: PooledScatter) -> Drift | None:
    """Change of the error along the flight number, from the first to the last repeated flight; None without repeats.

    Least squares with one slope for all policies, each at its own level (analysis of covariance), and the pooled
    scatter; the test is two-sided. For a single repeat it is the difference of the two flights.
    """
    repeated = [group for group in groups if group.size > 1]
    if not repeated:
        return None
    numbers = [np.array(group.numbers, dtype=np.float64) for group in repeated]
    centred = [own - own.mean() for own in numbers]
    spread = sum(float(own @ own) for own in centred)
    moved = sum(float(own @ np.array(group.errors)) for own, group in zip(centred, repeated, strict=True))
    first, last = min(group.numbers[0] for group in repeated), max(group.numbers[-1] for group in repeated)
    difference = moved / spread * (last - first)
    standard_error = scatter.sigma / sqrt(spread) * (last - first)
    return Drift(
        first_number=first,
        last_number=last,
        difference=difference,
        standard_error=standard_error,
        confidence=_certainty(difference, standard_error, scatter.degrees_of_freedom, 2),
    )


def trend_of(x: Sequence[float], errors: Sequence[float], confidence: float = 0.9) -> Trend | None:
    """Least squares line through at least three points, with the t interval of its slope, n − 2 degrees of freedom.

    The paper's Fig. 12: error against battery voltage. None if there are fewer points, or x does not vary.
    """
    from scipy.special import stdtrit

    along, measured = np.array(x, dtype=np.float64), np.array(errors, dtype=np.float64)
    if len(along) < 3 or np.ptp(along) == 0.0:
        return None
    centred: Vector = along - along.mean()
    spread = float(centred @ centred)
    slope = float(centred @ measured) / spread
    residual = measured - measured.mean() - slope * centred
    freedom = len(along) - 2
    standard_error = float(np.sqrt(residual @ residual / freedom / spread))
    half = float(stdtrit(freedom, 0.5 + confidence / 2)) * standard_error
    return Trend(
        slope=slope, standard_error=standard_error, lower=slope - half, upper=slope + half, confidence=confidence
    )


def smallest_difference(scatter: PooledScatter, flown: int, left: int, confidence: float) -> float:
    """Smallest difference that `left` flights can distinguish from noise with `confidence`.

    The flights are split optimally between a policy flown `flown` times already and a new one. Infinite without a
    flight left.
    """
    from scipy.special import stdtrit

    freedom = scatter.degrees_of_freedom + max(left - 1, 0)
    errors = [np.sqrt(1.0 / (flown + left - new) + 1.0 / new) for new in range(1, left + 1)]
    return float(stdtrit(freedom, confidence)) * scatter.sigma * float(min(errors, default=np.inf))


def _standard_error(scatter: PooledScatter, sizes: tuple[int, int]) -> float:
    return scatter.sigma * float(np.sqrt(1.0 / sizes[0] + 1.0 / sizes[1]))


def _certainty(difference: float, standard_error: float, degrees_of_freedom: float, allowance: float) -> float:
    """1 − allowance·P(t ≥ |difference|/standard error), at least zero."""
    from scipy.special import stdtr

    if standard_error == 0.0:
        return 1.0 if difference else 0.0
    tail = float(stdtr(degrees_of_freedom, -abs(difference) / standard_error))
    return max(1.0 - allowance * tail, 0.0)


def _further(
    first: Group, second: Group, scatter: PooledScatter, confidence: float, candidates: int, looks: int
) -> FlightsToDecide | None:
    """Add flights to the policy with fewer (the first of equals) until the same difference would be decided."""
    sizes = [first.size, second.size]
    for added in range(1, MAX_FURTHER_FLIGHTS + 1):
        sizes[0 if sizes[0] <= sizes[1] else 1] += 1
        standard_error = _standard_error(scatter, (sizes[0], sizes[1]))
        look = looks + added if looks else 0
        allowance = candidates * max(look * (look + 1), 1)
        freedom = scatter.degrees_of_freedom + added
        if _certainty(first.mean - second.mean, standard_error, freedom, allowance) >= confidence:
            return FlightsToDecide(first=sizes[0] - first.size, second=sizes[1] - second.size)
    return None


def undecided(comparison: Comparison, found: str, further: str = "") -> str:
    """Sentence for what was `found` without a result; `further` says what would decide."""
    if comparison.confidence is None:
        return f"Not known yet: {found}. {SCATTER_NOT_KNOWN}"
    return f"Unresolved: {found}, {confidence_text(comparison.confidence)} confidence. {further}"


def deciding_flights(comparison: Comparison, first: str, second: str, joint: str = ", ") -> str:
    """The further flights that would decide an unresolved comparison, in a sentence; `first` and `second` say of whose
    gains."""
    further = comparison.further
    if further is None:
        return "Even 100 more flights would not resolve it."
    shares = joint.join(f"{n} {whose}" for n, whose in ((further.first, first), (further.second, second)) if n)
    return f"If the difference persists, {count(further.total, 'more flight')} would resolve it: {shares}."
