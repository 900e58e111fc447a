"""Comparison of flights: what differs between them, its effect on the error, and their curves.

Each flight counts with all valid flights of its gains in its campaign, and the scatter is that of its population, so
flights of one campaign have the same verdict as in that campaign. Between populations there is no verdict, because
vehicle and gains differ together; only the errors are reported.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from app.campaigns import history
from app.campaigns.trials.schemas import GroupBrief
from app.campaigns.trials.views import CONFIDENCE
from app.compare.compared_flights import (
    ComparisonFlight,
    capitalised,
    file_stem,
    gain_differences,
    named,
    setting_differences,
    settings_of,
    sides_of,
    vehicle_name,
)
from app.compare.schemas import Basis, ComparedFlight, FlightComparison, FlightPair, FurtherFlights
from app.core.formatting import confidence_text, direction_of, format_gains, measured
from app.core.records.trajectory import CHANNEL_UNITS, Samples
from app.core.statistics.comparisons import Comparison, Group, Verdict, compare, drift_of
from app.core.tuning.confirmation import SCATTER_NOT_KNOWN, deciding_flights
from app.db import trajectories
from app.figures.base import Card, card_of
from app.figures.comparison import ComparedCurve, ComparisonData, ComparisonFigure
from app.figures.data import Curve
from app.figures.theme import ThemeName
from app.fleet import service as fleet

GRID_STEP_S: Final = 0.02


def compare_flights(session: Session, trial_ids: Sequence[int]) -> FlightComparison:
    """Compare the flights. Raises InputError naming those that cannot be compared."""
    sides = sides_of(session, trial_ids)
    flown = history.latest_flights(session, trial_ids)
    settings = [settings_of(side, flown[side.row.id].battery if side.row.id in flown else "") for side in sides]
    leading = find_leading_pair(sides)
    verdict, sentence = overall_verdict(leading)
    return FlightComparison(
        error_unit=sides[0].experiment.error_unit,
        verdict=verdict,
        sentence=sentence,
        notes=list_notes(sides),
        flights=[
            ComparedFlight.view_of(
                side.row,
                trial_id=side.row.id,
                label=side.label,
                name=side.name,
                campaign_name=side.campaign.name,
                vehicle=vehicle_name(side.campaign),
                is_real=side.campaign.vehicle.is_real,
                experiment=side.experiment.title,
                group=None
                if side.group is None
                else GroupBrief(
                    mean=side.group.mean, standard_error=side.group.known_error(side.scatter), n=side.group.size
                ),
                scatter=side.scatter.reported,
                settings=own,
            )
            for side, own in zip(sides, settings, strict=True)
        ],
        gains=gain_differences(sides),
        settings=setting_differences(settings),
        pairs=compare_pairs(sides, leading),
        file_stem=file_stem([side.row for side in sides]),
    )


def comparison_figure(session: Session, trial_ids: Sequence[int], theme: ThemeName) -> Card:
    """The curves over the set point. Raises InputError naming the flights that cannot be compared."""
    return card_of(ComparisonFigure(_drawn(session, sides_of(session, trial_ids)), theme))


def export_curves(session: Session, trial_ids: Sequence[int]) -> tuple[str, str]:
    """File name and CSV of the curves, every 0.02 s from the command to the end of the longest record.

    Linear between samples, empty outside a record. Raises InputError naming the flights that cannot be compared.
    """
    sides = sides_of(session, trial_ids)
    data = _drawn(session, sides)
    ends = [float(flight.curve.time_s[-1]) for flight in data.flights if flight.curve is not None]
    grid = np.arange(round(max(ends, default=0.0) / GRID_STEP_S) + 1, dtype=np.float64) * GRID_STEP_S
    unit = data.output_unit
    columns = {"time_s": [f"{second:.2f}" for second in grid], f"set_point_{unit}": _column(data.set_point, grid)}
    for side, flight in zip(sides, data.flights, strict=True):
        title = f"campaign_{side.campaign.id}_flight_{side.row.number}_{side.experiment.output}"
        columns[title] = _column(flight.curve, grid)
    lines = [",".join(columns), *(",".join(cells) for cells in zip(*columns.values(), strict=True))]
    return f"{file_stem([side.row for side in sides])}.csv", "\n".join(lines) + "\n"


def _column(curve: Curve | None, grid: Samples) -> list[str]:
    if curve is None or len(curve.time_s) == 0:
        return [""] * len(grid)
    values = np.interp(grid, curve.time_s, curve.values, left=np.nan, right=np.nan)
    return ["" if np.isnan(value) else f"{value:.6g}" for value in values]


def _drawn(session: Session, sides: Sequence[ComparisonFlight]) -> ComparisonData:
    experiment = sides[0].experiment
    recorded = [side.row.trajectory_id for side in sides if side.row.trajectory_id is not None]
    records = trajectories.trajectories_of(session, recorded)
    unit = CHANNEL_UNITS[experiment.output]
    return ComparisonData(
        output_title=experiment.output.removesuffix(f"_{unit}").replace("_", " ").capitalize(),
        output_unit=unit,
        error_unit=experiment.error_unit,
        set_point=Curve(experiment.grid_s, experiment.set_point(experiment.grid_s)),
        flights=tuple(
            ComparedCurve(
                trial_id=side.row.id,
                label=side.label,
                name=side.name,
                curve=None
                if side.row.trajectory_id is None
                else Curve(
                    records[side.row.trajectory_id].time_s, records[side.row.trajectory_id][side.experiment.output]
                ),
                error=side.row.error,
            )
            for side in sides
        ),
    )


def compare_pair(side: ComparisonFlight, against: ComparisonFlight, *, candidates: int = 1) -> FlightPair:
    """Compare `side` with `against`; `side` was chosen among that many `candidates` for its low error."""
    if side.group is None or against.group is None:
        missing = side if side.group is None else against
        sentence = f"{capitalised(missing.name)} is {missing.row.state}: it has no error that counts."
        return _pair(side, against, "no error", sentence)
    if side.population != against.population:
        return _apart(side, side.group, against, against.group)
    if side.group is against.group:
        return _repeats(side, against, side.group)
    comparison = compare(side.group, against.group, side.scatter, CONFIDENCE, candidates=candidates)
    same = dict(side.group.gains) == dict(against.group.gains)
    sentence = (
        _changed(side, against, comparison)
        if same
        else _comparison_sentence(side, side.group, against, against.group, comparison)
    )
    further = comparison.further
    return _pair(
        side,
        against,
        "repeats" if same else "gains",
        sentence,
        verdict=comparison.verdict,
        confidence=comparison.confidence,
        difference=comparison.difference,
        standard_error=comparison.standard_error,
        further=None if further is None else FurtherFlights(trial=further.first, against=further.second),
    )


@dataclass(frozen=True, slots=True)
class LeadingPair:
    """The flight with the lowest mean plus its standard error among the `policies` that were flown, and the one that it
    is compared with: the first flight, or the next lowest if it has the first flight's gains."""

    best: ComparisonFlight
    other: ComparisonFlight
    policies: int

    @property
    def candidates(self) -> int:
        return max(1, self.policies - 1)

    def is_of(self, side: ComparisonFlight, against: ComparisonFlight) -> bool:
        """Whether the two flights have the gains of this pair."""
        return {id(side.group), id(against.group)} == {id(self.best.group), id(self.other.group)}


def find_leading_pair(sides: Sequence[ComparisonFlight]) -> LeadingPair | None:
    """None if fewer than two flights have an error that counts."""
    ranked = sorted((side for side in sides if side.group is not None), key=_rank)
    if len(ranked) < 2:
        return None
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
    pair = compare_pair(leading.best, leading.other, candidates=leading.candidates)
    among = (
        f"{capitalised(leading.best.name)} is the lowest of {leading.policies} gain sets, and the confidence allows "
        "for this choice. "
    )
    return pair.verdict, f"{among if leading.policies > 2 else ''}{pair.sentence}"


def compare_pairs(sides: Sequence[ComparisonFlight], leading: LeadingPair | None) -> list[FlightPair]:
    """Compare each flight with every earlier one of the list; the gains of the leading pair have the confidence of the
    overall verdict, which allows for their choice."""
    return [
        compare_pair(
            later,
            earlier,
            candidates=leading.candidates if leading is not None and leading.is_of(later, earlier) else 1,
        )
        for earlier, later in combinations(sides, 2)
    ]


def list_notes(sides: Sequence[ComparisonFlight]) -> list[str]:
    """Caveats that apply to the numbers."""
    first = sides[0]
    apart = dict.fromkeys(_why_apart(side, first)[1] for side in sides if side.population != first.population)
    campaigns: dict[str, set[int]] = {}
    for side in sides:
        campaigns.setdefault(side.population, set()).add(side.campaign.id)
    scatters = {side.population: side.scatter for side in sides}
    shared = [
        f"Scatter of one flight: {scatters[population].sigma:.4f} {first.experiment.error_unit}, pooled over repeats "
        f"in {len(members)} campaigns of the same vehicle and experiment."
        for population, members in campaigns.items()
        if len(members) > 1 and scatters[population].known
    ]
    return [*apart, *shared]


def _rank(side: ComparisonFlight) -> tuple[float, str]:
    assert side.group is not None
    return side.group.mean + side.group.standard_error(side.scatter), side.label


def _pair(
    side: ComparisonFlight, against: ComparisonFlight, basis: Basis, sentence: str, **found: object
) -> FlightPair:
    """The pair with what was `found` of it; null for the other fields."""
    known = {"trial_id": side.row.id, "against_id": against.row.id, "basis": basis, "sentence": sentence, **found}
    return FlightPair.model_validate(dict.fromkeys(FlightPair.model_fields) | known)


def _apart(side: ComparisonFlight, own: Group, against: ComparisonFlight, other: Group) -> FlightPair:
    """Compare two means with different scatters: the difference has the sum of both variances."""
    difference = own.mean - other.mean
    known = side.scatter.known and against.scatter.known
    uncertainty = math.hypot(own.standard_error(side.scatter), other.standard_error(against.scatter))
    standard_error = uncertainty if known else None
    amount = measured(abs(difference), standard_error, side.experiment.error_unit)
    how, _ = _why_apart(side, against)
    apart = f"{amount} {direction_of(difference)} than {against.name}"
    sentence = f"No verdict on the gains: {side.name}, {how}, is {apart}."
    return _pair(side, against, "apart", sentence, difference=difference, standard_error=standard_error)


def _why_apart(side: ComparisonFlight, against: ComparisonFlight) -> tuple[str, str]:
    """What differs between the two campaigns besides the gains: in short, and as a sentence with its consequence."""
    one, other = side.campaign.vehicle, against.campaign.vehicle
    if side.experiment.name != against.experiment.name:
        how, what = (
            "in another experiment",
            f"Different experiments ({against.experiment.title}, {side.experiment.title})",
        )
    elif one.id != other.id:
        how, what = "flown by another vehicle", f"Different vehicles ({other.title}, {one.title})"
    elif not fleet.can_fly(one):
        how = "perhaps flown by another vehicle"
        what = "Flights flown elsewhere: it is unknown whether the same vehicle flew both campaigns"
    else:
        how, what = "flown with different settings of the vehicle", "One vehicle with different settings"
    return (
        how,
        f"{what}. The errors depend on this as well as on the gains. To compare gains, fly both in one campaign.",
    )


def _repeats(side: ComparisonFlight, against: ComparisonFlight, group: Group) -> FlightPair:
    """Compare two flights of the same gains in one campaign: whether anything has changed between them."""
    errors = dict(zip(group.numbers, group.errors, strict=True))
    earlier, later = sorted((against.row.number, side.row.number))
    found = drift_of([Group(group.gains, (earlier, later), (errors[earlier], errors[later]))], side.scatter)
    assert found is not None
    amount = measured(abs(found.difference), found.standard_error, side.experiment.error_unit)
    relation = (
        "more than the scatter of flights" if found.confidence >= CONFIDENCE else "no more than the scatter of flights"
    )
    sentence = (
        f"The same gains ({format_gains(group.gains)}): {side.name} and {against.name} are {amount} apart, {relation} "
        f"({confidence_text(found.confidence)} confidence that something has changed)."
    )
    return _pair(
        side,
        against,
        "repeats",
        sentence,
        difference=found.difference if side.row.number == later else -found.difference,
        standard_error=found.standard_error,
        confidence=found.confidence,
    )


def _changed(side: ComparisonFlight, against: ComparisonFlight, comparison: Comparison) -> str:
    """Sentence for the same gains in two campaigns."""
    amount = measured(abs(comparison.difference), comparison.standard_error, side.experiment.error_unit)
    apart = f"{side.name} is {amount} {direction_of(comparison.difference)} than {against.name}"
    if comparison.confidence is None:
        return f"Not known yet: with the same gains in two campaigns {apart}. {SCATTER_NOT_KNOWN}"
    relation = (
        "within the scatter"
        if comparison.verdict == "unresolved"
        else "more than the scatter: the vehicle or its environment has changed"
    )
    sure = confidence_text(comparison.confidence)
    return f"The same gains in two campaigns: {apart}, {relation} ({sure} confidence)."


def _comparison_sentence(
    side: ComparisonFlight, own: Group, against: ComparisonFlight, other: Group, comparison: Comparison
) -> str:
    amount = measured(abs(comparison.difference), comparison.standard_error, side.experiment.error_unit)
    pair = f"{named(own, side.name)} against {named(other, against.name)}"
    if comparison.confidence is None:
        return f"Not known yet: {pair}, {amount} {direction_of(comparison.difference)}. {SCATTER_NOT_KNOWN}"
    both = f"{amount} {direction_of(comparison.difference)}, {confidence_text(comparison.confidence)} confidence"
    if comparison.verdict == "unresolved":
        whose = f"with the gains of {side.name}", f"with the gains of {against.name}"
        return f"Unresolved: {pair}, {both}. {deciding_flights(comparison, *whose, ' and ')}"
    return f"{capitalised(named(own, side.name))} is {comparison.verdict} than {named(other, against.name)}: {both}."
