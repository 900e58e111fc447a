"""The compared flights, each with its gain group, scatter, vehicle and settings, and the differences between them."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeGuard

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.autopilots.registry import experiment_of, get_experiment
from app.campaigns import history
from app.campaigns import service as campaigns_service
from app.campaigns.definitions import definition_of
from app.common.errors import InputError, Problem
from app.common.schemas import OptionValue
from app.compare.schemas import FlightDifference, FlightSetting
from app.core.definition import Option, with_defaults
from app.core.experiments.base import Experiment
from app.core.formatting import count, format_gains
from app.core.statistics.comparisons import Group, PooledScatter, groups_of, pool_scatter
from app.core.tuning.strategies import STRATEGIES
from app.db.models import CampaignRow, TrialRow
from app.fleet import service as fleet
from app.vehicles.registry import VEHICLE_KINDS


def named(group: Group, name: str) -> str:
    """`flight 3 (kp 400, ki 20, kd 100; 2 flights)`: a flight with its gains and their number of flights."""
    return f"{name} ({format_gains(group.gains)}; {count(group.size, 'flight')})"


def capitalised(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]


def names_of(rows: Sequence[TrialRow], campaigns: Mapping[int, CampaignRow]) -> list[str]:
    """`flight 3`; with the campaign's name if there are several, and with its id if two have the same name."""
    used = {row.campaign_id: campaigns[row.campaign_id].name for row in rows}
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


LABELS: Final = "ABCDEFGHIJKLMNOPQRST"
MAX_FLIGHTS: Final = len(LABELS)


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonFlight:
    """One flight of a comparison.

    `group` holds the valid flights with its gains in its campaign, None if the flight is not one of them. `scatter` is
    pooled over the compared campaigns of the same `population`: those in which the same vehicle flew the same
    experiment.
    """

    row: TrialRow
    campaign: CampaignRow
    experiment: Experiment
    label: str
    name: str
    group: Group | None
    scatter: PooledScatter
    population: str


def sides_of(session: Session, trial_ids: Sequence[int]) -> list[ComparisonFlight]:
    """Collect the flights in the given order.

    Raises InputError naming those (`trial.0`, `trial.1`, …) that cannot be compared.
    """
    found = {row.id: row for row in session.scalars(select(TrialRow).where(TrialRow.id.in_(trial_ids)))}
    campaigns = {row.campaign_id: campaigns_service.get_row(session, row.campaign_id) for row in found.values()}
    experiments = {key: experiment_of(definition_of(campaign)) for key, campaign in campaigns.items()}
    problems = [
        Problem(f"trial.{index}", reason)
        for index, trial_id in enumerate(trial_ids)
        if (reason := _refusal(trial_ids, index, found.get(trial_id), found, experiments)) is not None
    ]
    if problems:
        raise InputError(
            "These flights cannot be compared.",
            hint="Remove the flights listed, or choose others.",
            problems=tuple(problems),
        )
    rows = [found[trial_id] for trial_id in trial_ids]
    groups = {
        key: groups_of(history.flown_gains(history.trials_of(session, key)))
        for key in {row.campaign_id for row in rows}
    }
    scatters = _scatters(campaigns, experiments, groups)
    return [
        ComparisonFlight(
            row=row,
            campaign=campaigns[row.campaign_id],
            experiment=experiments[row.campaign_id],
            label=label,
            name=name,
            group=next((group for group in groups[row.campaign_id] if row.number in group.numbers), None),
            scatter=scatters[population],
            population=population,
        )
        for row, label, name in zip(rows, LABELS, names_of(rows, campaigns), strict=False)
        for population in [population_of(campaigns[row.campaign_id])]
    ]


def population_of(campaign: CampaignRow) -> str:
    """A key common to campaigns whose flights differ only in their gains: same vehicle, settings and experiment.

    For flights flown elsewhere the vehicle is not known, so such a campaign is a population of its own.
    """
    vehicle = campaign.vehicle
    if not fleet.can_fly(vehicle):
        return f"campaign {campaign.id}"
    options = {} if vehicle.registered else campaign.vehicle_options
    offered = get_experiment(campaign.experiment).options
    experiment = [campaign.experiment, with_defaults(definition_of(campaign).experiment_options, offered)]
    return json.dumps([vehicle.id, options, experiment], sort_keys=True)


def _scatters(
    campaigns: Mapping[int, CampaignRow],
    experiments: Mapping[int, Experiment],
    groups: Mapping[int, Sequence[Group]],
) -> dict[str, PooledScatter]:
    members: dict[str, list[int]] = {}
    for key in groups:
        members.setdefault(population_of(campaigns[key]), []).append(key)
    return {
        population: pool_scatter([group for key in keys for group in groups[key]], experiments[keys[0]].scatter)
        for population, keys in members.items()
    }


def _refusal(
    trial_ids: Sequence[int],
    index: int,
    row: TrialRow | None,
    found: Mapping[int, TrialRow],
    experiments: Mapping[int, Experiment],
) -> str | None:
    """Why the flight at this index cannot be compared, or None if it can."""
    trial_id = trial_ids[index]
    if row is None:
        return f"there is no trial {trial_id}; its campaign may have been deleted"
    if trial_id in trial_ids[:index]:
        return f"flight {row.number} of campaign {row.campaign_id} is listed twice"
    if row.state not in history.FLOWN:
        return f"flight {row.number} of campaign {row.campaign_id} has not flown: it is {row.state}"
    first = next(found[other] for other in trial_ids if other in found)
    own, wanted = experiments[row.campaign_id], experiments[first.campaign_id]
    if own.error_unit != wanted.error_unit:
        differ = f"is in {own.error_unit}", f"in {wanted.error_unit}"
    elif own.measure != wanted.measure:
        differ = f"is of {own.measure}", f"of {wanted.measure}"
    elif own.window_s != wanted.window_s:
        differ = f"covers a window of {own.window_s:g} s", f"one of {wanted.window_s:g} s"
    else:
        return None
    return (
        f"the error of flight {row.number} of campaign {row.campaign_id} {differ[0]}, that of flight {first.number} "
        f"of campaign {first.campaign_id} {differ[1]}: the errors are different quantities"
    )


def vehicle_name(campaign: CampaignRow) -> str:
    """A registered vehicle's own name, otherwise its kind."""
    vehicle = campaign.vehicle
    return vehicle.name if vehicle.registered else vehicle.title


def settings_of(side: ComparisonFlight, battery: str) -> list[FlightSetting]:
    """Vehicle, experiment and strategy with their settings, the battery, and other recorded settings of a flight."""
    row, campaign = side.row, side.campaign
    kind = VEHICLE_KINDS.get(campaign.vehicle.kind)
    strategy = STRATEGIES[campaign.strategy]
    options = fleet.options_of(campaign)
    found = [
        FlightSetting(title="Vehicle", unit="", value=vehicle_name(campaign)),
        *_options(options, () if kind is None else kind.options),
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
    described = {option.name: option for option in known}
    return [
        FlightSetting(
            title=described[name].title if name in described else name,
            unit=described[name].unit if name in described else "",
            value=value,
        )
        for name, value in values.items()
    ]


def _differing(rows: Iterable[tuple[str, str, list[OptionValue | None]]]) -> list[FlightDifference]:
    return [
        FlightDifference(title=title, unit=unit, values=values, changes=[_change(values[0], one) for one in values])
        for title, unit, values in rows
        if any(one != values[0] for one in values)
    ]


def _change(first: OptionValue | None, value: OptionValue | None) -> int | float | None:
    if _is_number(first) and _is_number(value):
        return value - first
    return None


def _is_number(value: OptionValue | None) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
