"""Verdicts on pairs of flights of any campaigns: whose gains are better, or whether the same gains still fly alike.

Each flight counts with all valid flights of its gains in its campaign, and the scatter is that of its population, so
flights of one campaign have the same verdict as in that campaign. Between populations there is no verdict, because
vehicle and gains differ together; only the errors are reported.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from app.core.formatting import capitalised, confidence_text, count, direction_of, format_gains, measured
from app.core.statistics.comparisons import (
    Comparison,
    FlightsToDecide,
    Group,
    PooledScatter,
    Verdict,
    compare,
    deciding_flights,
    drift_of,
    undecided,
)

Basis = Literal["gains", "repeats", "apart", "no error"]

CONFIDENCE: Final = 0.9
"""Probability from which on a difference between two flights counts as resolved."""


@dataclass(frozen=True, slots=True)
class Population:
    """Flights that differ only in their gains: of one vehicle and one experiment, each by its title, with the same
    settings. It is not `known` which vehicle flew elsewhere, so each such campaign is a population of its own."""

    vehicle_id: int
    vehicle: str
    experiment: str
    settings: str
    known: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One flight of a pair, with its `name` in sentences and its `state`.

    `group` holds the valid flights with its gains in its campaign, None if the flight is not one of them. `scatter` is
    pooled over the compared campaigns of the same `population`.
    """

    number: int
    name: str
    state: str
    campaign_id: int
    error_unit: str
    group: Group | None
    scatter: PooledScatter
    population: Population

    @property
    def subject(self) -> str:
        """The name at the beginning of a sentence."""
        return capitalised(self.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairVerdict:
    """One flight's gains compared with another's; `difference` is first − second."""

    basis: Basis
    sentence: str
    verdict: Verdict | None = None
    confidence: float | None = None
    difference: float | None = None
    standard_error: float | None = None
    further: FlightsToDecide | None = None


@dataclass(frozen=True, slots=True)
class LeadingPair:
    """The flight with the lowest mean plus its standard error among the `policies` that were flown, and the one that it
    is compared with: the first flight, or the next lowest if it has the first flight's gains."""

    best: Side
    other: Side
    policies: int

    def candidates_for(self, side: Side, against: Side) -> int:
        """Number of policies from which the first of two flights was chosen for its low error: more than one only for
        the gains of this pair."""
        is_own = {id(side.group), id(against.group)} == {id(self.best.group), id(self.other.group)}
        return max(1, self.policies - 1) if is_own else 1


def find_leading_pair(sides: Sequence[Side]) -> LeadingPair | None:
    """None if fewer than two flights have an error that counts."""
    counted = [(side.group.pessimistic(side.scatter), place) for place, side in enumerate(sides) if side.group]
    if len(counted) < 2:
        return None
    ranked = [sides[place] for _, place in sorted(counted)]
    best, first = ranked[0], sides[0]
    other = (
        first
        if first.group not in (None, best.group)
        else next((side for side in ranked if side.group is not best.group), ranked[1])
    )
    return LeadingPair(best, other, policies=len({id(side.group) for side in ranked}))


def overall_verdict(leading: LeadingPair | None) -> tuple[Verdict | None, str]:
    """Compare the best gains with the first flight's, as in a campaign."""
    if leading is None:
        return None, "No verdict: fewer than two of these flights have an error that counts."
    pair = compare_pair(leading.best, leading.other, leading)
    among = (
        f"{leading.best.subject} is the lowest of {leading.policies} gain sets, and the confidence allows for this "
        "choice. "
    )
    return pair.verdict, f"{among if leading.policies > 2 else ''}{pair.sentence}"


def compare_pair(side: Side, against: Side, leading: LeadingPair | None = None) -> PairVerdict:
    """Compare `side` with `against`; the gains of the leading pair have the confidence of the overall verdict, which
    allows for their choice."""
    own, other = side.group, against.group
    if own is None or other is None:
        missing = side if own is None else against
        return PairVerdict(
            basis="no error", sentence=f"{missing.subject} is {missing.state}: it has no error that counts."
        )
    if side.population != against.population:
        return _apart(side, own, against, other)
    if own is other:
        return _repeats(side, against, own)
    candidates = 1 if leading is None else leading.candidates_for(side, against)
    comparison = compare(own, other, side.scatter, CONFIDENCE, candidates=candidates)
    same = dict(own.gains) == dict(other.gains)
    return PairVerdict(
        basis="repeats" if same else "gains",
        sentence=_changed(side, against, comparison) if same else _compared(side, own, against, other, comparison),
        verdict=comparison.verdict,
        confidence=comparison.confidence,
        difference=comparison.difference,
        standard_error=comparison.standard_error,
        further=comparison.further,
    )


def list_notes(sides: Sequence[Side]) -> list[str]:
    """Caveats that apply to the numbers."""
    first = sides[0]
    apart = dict.fromkeys(_why_apart(side, first)[1] for side in sides if side.population != first.population)
    scatters = {side.population: side.scatter for side in sides}
    campaigns = Counter(population for _, population in {(side.campaign_id, side.population) for side in sides})
    shared = [
        f"Scatter of one flight: {scatter.sigma:.4f} {first.error_unit}, pooled over repeats in "
        f"{campaigns[population]} campaigns of the same vehicle and experiment."
        for population, scatter in scatters.items()
        if campaigns[population] > 1 and scatter.known
    ]
    return [*apart, *shared]


def _apart(side: Side, own: Group, against: Side, other: Group) -> PairVerdict:
    """Compare two means with different scatters: the difference has the sum of both variances."""
    difference = own.mean - other.mean
    known = side.scatter.known and against.scatter.known
    uncertainty = math.hypot(own.standard_error(side.scatter), other.standard_error(against.scatter))
    standard_error = uncertainty if known else None
    amount = measured(abs(difference), standard_error, side.error_unit)
    how, _ = _why_apart(side, against)
    apart = f"{amount} {direction_of(difference)} than {against.name}"
    sentence = f"No verdict on the gains: {side.name}, {how}, is {apart}."
    return PairVerdict(basis="apart", sentence=sentence, difference=difference, standard_error=standard_error)


def _why_apart(side: Side, against: Side) -> tuple[str, str]:
    """What differs between the two campaigns besides the gains: in short, and as a sentence with its consequence."""
    one, other = side.population, against.population
    if one.experiment != other.experiment:
        how, what = "in another experiment", f"Different experiments ({other.experiment}, {one.experiment})"
    elif one.vehicle_id != other.vehicle_id:
        how, what = "flown by another vehicle", f"Different vehicles ({other.vehicle}, {one.vehicle})"
    elif not one.known:
        how = "perhaps flown by another vehicle"
        what = "Flights flown elsewhere: it is unknown whether the same vehicle flew both campaigns"
    else:
        how, what = "flown with different settings of the vehicle", "One vehicle with different settings"
    return (
        how,
        f"{what}. The errors depend on this as well as on the gains. To compare gains, fly both in one campaign.",
    )


def _repeats(side: Side, against: Side, group: Group) -> PairVerdict:
    """Compare two flights of the same gains in one campaign: whether anything has changed between them."""
    errors = dict(zip(group.numbers, group.errors, strict=True))
    earlier, later = sorted((against.number, side.number))
    found = drift_of([Group(group.gains, (earlier, later), (errors[earlier], errors[later]))], side.scatter)
    assert found is not None
    amount = measured(abs(found.difference), found.standard_error, side.error_unit)
    relation = (
        "more than the scatter of flights" if found.confidence >= CONFIDENCE else "no more than the scatter of flights"
    )
    sentence = (
        f"The same gains ({format_gains(group.gains)}): {side.name} and {against.name} are {amount} apart, {relation} "
        f"({confidence_text(found.confidence)} confidence that something has changed)."
    )
    return PairVerdict(
        basis="repeats",
        sentence=sentence,
        difference=found.difference if side.number == later else -found.difference,
        standard_error=found.standard_error,
        confidence=found.confidence,
    )


def _apart_by(side: Side, comparison: Comparison) -> str:
    amount = measured(abs(comparison.difference), comparison.standard_error, side.error_unit)
    return f"{amount} {direction_of(comparison.difference)}"


def _changed(side: Side, against: Side, comparison: Comparison) -> str:
    """Sentence for the same gains in two campaigns."""
    apart = f"{side.name} is {_apart_by(side, comparison)} than {against.name}"
    if comparison.confidence is None:
        return undecided(comparison, f"with the same gains in two campaigns {apart}")
    relation = (
        "within the scatter"
        if comparison.verdict == "unresolved"
        else "more than the scatter: the vehicle or its environment has changed"
    )
    sure = confidence_text(comparison.confidence)
    return f"The same gains in two campaigns: {apart}, {relation} ({sure} confidence)."


def _compared(side: Side, own: Group, against: Side, other: Group, comparison: Comparison) -> str:
    named, than = (
        f"{each.name} ({format_gains(group.gains)}; {count(group.size, 'flight')})"
        for each, group in ((side, own), (against, other))
    )
    apart = _apart_by(side, comparison)
    if comparison.verdict in ("unresolved", "not known yet"):
        whose = f"with the gains of {side.name}", f"with the gains of {against.name}"
        return undecided(comparison, f"{named} against {than}, {apart}", deciding_flights(comparison, *whose, " and "))
    sure = confidence_text(comparison.confidence or 0.0)
    return f"{capitalised(named)} is {comparison.verdict} than {than}: {apart}, {sure} confidence."
