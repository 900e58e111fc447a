"""Comparison of flights: what differs between them, its effect on the error (`app.core.statistics.pairs`), and their
curves."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from app.autopilots.registry import experiment_of
from app.campaigns import history
from app.campaigns.definitions import definition_of
from app.campaigns.trials.schemas import GroupBrief
from app.common.errors import InputError, Problem
from app.common.schemas import OptionValue
from app.common.states import FLOWN_TRIAL_STATES
from app.compare.schemas import (
    ComparedFlight,
    FlightComparison,
    FlightDifference,
    FlightPair,
    FlightSetting,
    FurtherFlights,
)
from app.core.definition import Option, titled, with_defaults
from app.core.experiments.base import Experiment
from app.core.records.trajectory import CHANNEL_UNITS, Samples
from app.core.statistics.comparisons import groups_of, pool_scatter
from app.core.statistics.pairs import (
    LeadingPair,
    Population,
    Side,
    compare_pair,
    find_leading_pair,
    list_notes,
    overall_verdict,
)
from app.core.tuning.strategies import STRATEGIES
from app.db.models import CampaignRow, TrialRow
from app.db.trajectories import samples_of, unpack
from app.figures.base import Card, card_of
from app.figures.comparison import ComparedCurve, ComparisonData, ComparisonFigure
from app.figures.data import NO_CURVE, Curve
from app.figures.theme import ThemeName
from app.fleet import service as fleet
from app.vehicles.registry import VEHICLE_KINDS

LABELS: Final = "ABCDEFGHIJKLMNOPQRST"


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonFlight(Side):
    """One flight of a comparison; `label` is its letter in the figure."""

    row: TrialRow
    experiment: Experiment
    label: str


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
                campaign_name=side.row.campaign.name,
                vehicle=vehicle_name(side.row.campaign),
                is_real=side.row.campaign.vehicle.is_real,
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
        pairs=[_pair(later, earlier, leading) for earlier, later in combinations(sides, 2)],
        file_stem=file_stem([side.row for side in sides]),
    )


def _pair(side: ComparisonFlight, against: ComparisonFlight, leading: LeadingPair | None) -> FlightPair:
    found = compare_pair(side, against, leading)
    further = found.further and FurtherFlights(trial=found.further.first, against=found.further.second)
    return FlightPair.view_of(found, trial_id=side.row.id, against_id=against.row.id, further=further)


def comparison_figure(session: Session, trial_ids: Sequence[int], theme: ThemeName) -> Card:
    """The curves over the set point. Raises InputError naming the flights that cannot be compared."""
    return card_of(ComparisonFigure(_drawn(session, sides_of(session, trial_ids)), theme_name=theme))


def export_curves(session: Session, trial_ids: Sequence[int]) -> tuple[str, str]:
    """File name and CSV of the curves, every 0.02 s from the command to the end of the longest record.

    Linear between samples, empty outside a record. Raises InputError naming the flights that cannot be compared.
    """
    sides = sides_of(session, trial_ids)
    data = _drawn(session, sides)
    ends = [float(flight.curve.time_s[-1]) for flight in data.flights if flight.curve]
    grid = np.arange(round(max(ends, default=0.0) / GRID_STEP_S) + 1, dtype=np.float64) * GRID_STEP_S
    unit = data.output_unit
    columns = {"time_s": [f"{second:.2f}" for second in grid], f"set_point_{unit}": _column(data.set_point, grid)}
    for side, flight in zip(sides, data.flights, strict=True):
        title = f"campaign_{side.campaign_id}_flight_{side.row.number}_{side.experiment.output}"
        columns[title] = _column(flight.curve, grid)
    lines = [",".join(columns), *(",".join(cells) for cells in zip(*columns.values(), strict=True))]
    return f"{file_stem([side.row for side in sides])}.csv", "\n".join(lines) + "\n"


def _column(curve: Curve, grid: Samples) -> list[str]:
    if not curve:
        return [""] * len(grid)
    values = np.interp(grid, curve.time_s, curve.values, left=np.nan, right=np.nan)
    return ["" if np.isnan(value) else f"{value:.6g}" for value in values]


def _drawn(session: Session, sides: Sequence[ComparisonFlight]) -> ComparisonData:
    experiment = sides[0].experiment
    recorded = [side.row.trajectory_id for side in sides if side.row.trajectory_id is not None]
    records = {key: unpack(row) for key, row in samples_of(session, recorded).items()}
    unit = CHANNEL_UNITS[experiment.output]
    return ComparisonData(
        output_title=experiment.output.removesuffix(f"_{unit}").replace("_", " ").capitalize(),
        output_unit=unit,
        error_unit=experiment.error_unit,
        set_point=Curve(experiment.grid_s, experiment.set_point(experiment.grid_s)),
        flights=tuple(
            ComparedCurve(
                index=index,
                trial_id=side.row.id,
                label=side.label,
                name=side.name,
                curve=NO_CURVE
                if side.row.trajectory_id is None
                else Curve(
                    records[side.row.trajectory_id].time_s, records[side.row.trajectory_id][side.experiment.output]
                ),
                error=side.row.error,
            )
            for index, side in enumerate(sides)
        ),
    )


def names_of(rows: Sequence[TrialRow]) -> list[str]:
    """`flight 3`; with the campaign's name if there are several, and with its id if two have the same name."""
    used = {row.campaign_id: row.campaign.name for row in rows}
    if len(used) == 1:
        return [f"flight {row.number}" for row in rows]
    alike = Counter(used.values())
    return [
        f"flight {row.number} of {(name := used[row.campaign_id])}"
        + (f" (campaign {row.campaign_id})" if alike[name] > 1 else "")
        for row in rows
    ]


def file_stem(rows: Sequence[TrialRow]) -> str:
    """`compare-campaign-3-flights-1-4-campaign-5-flight-2`; only the number of flights if that would be too long."""
    numbers: dict[int, list[int]] = {}
    for row in rows:
        numbers.setdefault(row.campaign_id, []).append(row.number)
    parts = [
        f"campaign-{campaign_id}-flight{'s' if len(flown) > 1 else ''}-{'-'.join(map(str, flown))}"
        for campaign_id, flown in numbers.items()
    ]
    stem = "-".join(["compare", *parts])
    return stem if len(stem) <= 80 else f"compare-{len(rows)}-flights"


def sides_of(session: Session, trial_ids: Sequence[int]) -> list[ComparisonFlight]:
    """Collect the flights in the given order.

    Raises InputError naming those (`trial.0`, `trial.1`, …) that cannot be compared.
    """
    found = {row.id: row for row in session.scalars(select(TrialRow).where(TrialRow.id.in_(trial_ids)))}
    campaigns = {row.campaign_id: row.campaign for row in found.values()}
    experiments = {key: experiment_of(definition_of(campaign)) for key, campaign in campaigns.items()}
    problems = [
        Problem(f"trial.{index}", reason)
        for index in range(len(trial_ids))
        if (reason := _refusal(trial_ids, index, found, experiments)) is not None
    ]
    if problems:
        raise InputError(
            "These flights cannot be compared.",
            hint="Remove the flights listed, or choose others.",
            problems=tuple(problems),
        )
    rows = [found[trial_id] for trial_id in trial_ids]
    groups = {key: groups_of(history.flown_gains(history.trials_of(session, key))) for key in campaigns}
    populations = {key: population_of(campaigns[key], experiments[key]) for key in campaigns}
    priors = {population: experiments[key].scatter for key, population in populations.items()}
    scatters = {
        population: pool_scatter(
            [each for key, own in groups.items() if populations[key] == population for each in own], prior
        )
        for population, prior in priors.items()
    }
    return [
        ComparisonFlight(
            row=row,
            experiment=experiment,
            label=label,
            number=row.number,
            name=name,
            state=row.state,
            campaign_id=row.campaign_id,
            error_unit=experiment.error_unit,
            group=next((group for group in groups[row.campaign_id] if row.number in group.numbers), None),
            scatter=scatters[population],
            population=population,
        )
        for row, label, name in zip(rows, LABELS, names_of(rows), strict=False)
        for experiment, population in [(experiments[row.campaign_id], populations[row.campaign_id])]
    ]


def population_of(campaign: CampaignRow, experiment: Experiment) -> Population:
    vehicle, is_known = campaign.vehicle, fleet.can_fly(campaign.vehicle)
    options = {} if vehicle.registered else campaign.vehicle_options
    chosen = with_defaults(definition_of(campaign).experiment_options, experiment.options)
    return Population(
        vehicle.id,
        vehicle.title,
        experiment.title,
        settings=json.dumps([options, chosen], sort_keys=True) if is_known else f"campaign {campaign.id}",
        known=is_known,
    )


def _refusal(
    trial_ids: Sequence[int], index: int, found: Mapping[int, TrialRow], experiments: Mapping[int, Experiment]
) -> str | None:
    """Why the flight at this index cannot be compared, or None if it can."""
    trial_id = trial_ids[index]
    if (row := found.get(trial_id)) is None:
        return f"there is no trial {trial_id}; its campaign may have been deleted"
    if trial_id in trial_ids[:index]:
        return f"flight {row.number} of campaign {row.campaign_id} is listed twice"
    if row.state not in FLOWN_TRIAL_STATES:
        return f"flight {row.number} of campaign {row.campaign_id} has not flown: it is {row.state}"
    first = next(found[other] for other in trial_ids if other in found)
    own, wanted = experiments[row.campaign_id], experiments[first.campaign_id]
    alike = (
        (f"is in {own.error_unit}", f"in {wanted.error_unit}", own.error_unit == wanted.error_unit),
        (f"is of {own.measure}", f"of {wanted.measure}", own.measure == wanted.measure),
        (f"covers a window of {own.window_s:g} s", f"one of {wanted.window_s:g} s", own.window_s == wanted.window_s),
    )
    reasons = (
        f"the error of flight {row.number} of campaign {row.campaign_id} {this}, that of flight {first.number} "
        f"of campaign {first.campaign_id} {that}: the errors are different quantities"
        for this, that, is_alike in alike
        if not is_alike
    )
    return next(reasons, None)


def vehicle_name(campaign: CampaignRow) -> str:
    """A registered vehicle's own name, otherwise its kind."""
    vehicle = campaign.vehicle
    return vehicle.name if vehicle.registered else vehicle.title


def settings_of(side: ComparisonFlight, battery: str) -> list[FlightSetting]:
    """Vehicle, experiment and strategy with their settings, the battery, and other recorded settings of a flight."""
    row, campaign = side.row, side.row.campaign
    strategy = STRATEGIES[campaign.strategy]
    options = fleet.options_of(campaign)
    found = [
        FlightSetting(title="Vehicle", unit="", value=vehicle_name(campaign)),
        *_options(options, VEHICLE_KINDS[campaign.vehicle.kind].options),
        FlightSetting(title="Experiment", unit="", value=side.experiment.title),
        *_options(
            with_defaults(campaign.definition["experiment_options"], side.experiment.options), side.experiment.options
        ),
        FlightSetting(title="Strategy", unit="", value=strategy.title),
        *_options(campaign.definition["options"], strategy.options),
        # As text, because the difference between two seeds has no meaning.
        FlightSetting(title="Seed of the campaign", unit="", value=str(campaign.definition["seed"])),
    ]
    if battery:
        found.append(FlightSetting(title="Battery", unit="", value=battery))
    if row.landing_battery_v is not None:
        found.append(FlightSetting(title="Battery after landing", unit="V", value=round(row.landing_battery_v, 2)))
    reported = row.settings.items() - options.items()
    return found + [FlightSetting(title=name, unit="", value=value) for name, value in sorted(reported)]


def setting_differences(flights: Sequence[Sequence[FlightSetting]]) -> list[FlightDifference]:
    """The settings that are not the same in all flights; None for a flight without that setting."""
    titles = dict.fromkeys((one.title, one.unit) for settings in flights for one in settings)
    values = [{(one.title, one.unit): one.value for one in settings} for settings in flights]
    return _differing((title, unit, [own.get((title, unit)) for own in values]) for title, unit in titles)


def gain_differences(sides: Sequence[ComparisonFlight]) -> list[FlightDifference]:
    """The gains that are not the same in all flights."""
    known = {gain.name: gain for side in sides for gain in side.experiment.space.gains}
    names = dict.fromkeys(name for side in sides for name in side.row.gains)
    return _differing(
        (name, known[name].unit if name in known else "", [side.row.gains.get(name) for side in sides])
        for name in names
    )


def _options(values: Mapping[str, OptionValue], known: Iterable[Option]) -> list[FlightSetting]:
    return [FlightSetting(title=title, unit=unit, value=value) for title, unit, value in titled(values, known)]


def _differing(rows: Iterable[tuple[str, str, list[OptionValue | None]]]) -> list[FlightDifference]:
    return [
        FlightDifference(title=title, unit=unit, values=values, changes=[_change(values[0], one) for one in values])
        for title, unit, values in rows
        if any(one != values[0] for one in values)
    ]


def _change(first: OptionValue | None, value: OptionValue | None) -> int | float | None:
    numbers = [each for each in (first, value) if isinstance(each, int | float) and not isinstance(each, bool)]
    return numbers[1] - numbers[0] if len(numbers) == 2 else None
