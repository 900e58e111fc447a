"""The compared flights, each with its gain group, scatter and vehicle."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import history
from app.campaigns import service as campaigns_service
from app.campaigns.definitions import definition_of
from app.common.errors import InputError, Problem
from app.compare import repository
from app.compare.words import names_of
from app.core.experiments import experiment_of
from app.core.experiments.base import Experiment
from app.core.statistics import Group, PooledScatter, groups_of, pool_scatter
from app.db.models import CampaignRow, TrialRow
from app.fleet import service as fleet

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
    found = repository.trials_by_id(session, trial_ids)
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
            hint="Leave the named flights out, or choose others.",
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

    For flights made elsewhere the vehicle is not known, so such a campaign is a population of its own.
    """
    vehicle = campaign.vehicle
    if not fleet.can_fly(vehicle):
        return f"campaign {campaign.id}"
    options = {} if vehicle.registered else campaign.vehicle_options
    experiment = [campaign.experiment, definition_of(campaign).experiment_options]
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
        return f"flight {row.number} of campaign {row.campaign_id} is named twice"
    if row.state not in history.FLOWN:
        return f"flight {row.number} of campaign {row.campaign_id} has not flown: it is {row.state}"
    first = next(found[other] for other in trial_ids if other in found)
    unit, wanted = experiments[row.campaign_id].error_unit, experiments[first.campaign_id].error_unit
    if unit == wanted:
        return None
    return (
        f"the error of flight {row.number} of campaign {row.campaign_id} is in {unit}, "
        f"that of flight {first.number} of campaign {first.campaign_id} in {wanted}: they measure different things"
    )
