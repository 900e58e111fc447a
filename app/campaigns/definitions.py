"""Conversion of a campaign's definition: from a request to the core, into its row, and back; with the donor of a warm
start, a flight of another campaign, looked up when the campaign is defined.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Final

from pydantic import TypeAdapter
from sqlalchemy.orm import Session

from app.autopilots.registry import EXPERIMENTS, REPLACEMENTS, evidence_of, experiment_of, get_experiment, offered
from app.campaigns import history, repository
from app.campaigns.schemas import Definition as DefinitionIn
from app.campaigns.schemas import Donor, Start
from app.common.errors import NotFoundError
from app.common.states import TrialState
from app.core.definition import Definition, problems_of_options
from app.core.errors import InputError, Problem
from app.core.experiments.base import Experiment
from app.core.tuning.definition_checks import highest_set_point_m, problems_of
from app.core.tuning.evidence import Evidence
from app.db.base import JsonObject
from app.db.models import CampaignRow, TrialRow
from app.fleet.schemas import VehicleChoice
from app.vehicles.base import OptionValue
from app.vehicles.registry import VEHICLE_KINDS, check_options

_ADAPTER: Final = TypeAdapter(Definition)


def core_definition(asked: DefinitionIn) -> Definition:
    """Convert a request's definition to the core's, unchecked."""
    return _ADAPTER.validate_python(asked.model_dump())


def definition_of(row: CampaignRow) -> Definition:
    """The definition of a stored campaign, with safe gains if they are not the experiment's defaults.

    The safe gains are the vehicle's, or those at the campaign's first flight once it has flown.
    """
    space = get_experiment(row.experiment).space
    own = dict(row.vehicle.safe_gains if row.safe_gains is None else row.safe_gains)
    default = space.mapping(space.default)
    are_others = own.keys() != default.keys()  # a placeholder of a vehicle elsewhere may serve several experiments
    safe_gains = None if are_others or own == default else own
    return replace(_ADAPTER.validate_python(row.definition), safe_gains=safe_gains)


def experiment_of_campaign(row: CampaignRow) -> Experiment:
    """The experiment of a stored campaign, configured as defined there."""
    return experiment_of(_ADAPTER.validate_python(row.definition))


def flown_evidence(row: CampaignRow, trials: Sequence[TrialRow]) -> Evidence[Experiment]:
    """The evidence of a campaign's flights without their records: their groups, scatter and winner."""
    return evidence_of(definition_of(row), history.flown_gains(trials))


def frozen_digest(row: CampaignRow) -> str:
    """SHA-256 over all that is frozen at the first flight.

    That is the definition, the vehicle (a registered one by its id, a shared one by all its settings), and its safe
    gains. Proposals carry the digest of the definition alone, because they depend on nothing else.
    """
    frozen = {
        "definition": definition_of(row).digest(),
        "vehicle": row.vehicle.kind,
        "options": row.vehicle_options,
        "safe_gains": row.vehicle.safe_gains if row.safe_gains is None else row.safe_gains,
        **({"vehicle_id": row.vehicle.id} if row.vehicle.registered else {}),
    }
    return hashlib.sha256(json.dumps(frozen, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def stored(definition: Definition) -> JsonObject:
    """The definition as stored in the row, without the safe gains, which are the vehicle's."""
    return {name: value for name, value in asdict(definition).items() if name != "safe_gains"}


def check_campaign(
    asked: DefinitionIn, vehicle: VehicleChoice, *, continues: str = ""
) -> tuple[Definition, dict[str, OptionValue]]:
    """Check a campaign; return its definition and the complete vehicle options.

    A registered vehicle has options of its own, so none are returned; its gains are compared with the experiment's in
    `fleet`. `continues` is the experiment of the stored campaign that this one changes or rehearses, which may be one
    that is no longer offered. Raises InputError that names everything invalid in either.
    """
    donor = asked.start.donor
    if donor is not None and donor.trial_number is None:
        raise InputError(
            "Invalid campaign.",
            problems=(Problem("definition.start.donor", "is allowed with start.kind 'campaign' only"),),
            hint="Remove the donor, or set start.kind to 'campaign'.",
        )
    definition = core_definition(asked)
    problems = [Problem(f"definition.{each.field}", each.reason) for each in problems_of(definition, EXPERIMENTS)]
    if (replaced := definition.experiment) in REPLACEMENTS and replaced != continues:
        reason = f"{replaced!r} is no longer offered for new campaigns; use {REPLACEMENTS[replaced]!r} instead"
        problems.insert(0, Problem("definition.experiment", reason))
    options: dict[str, OptionValue] = {}
    try:
        options |= check_options(vehicle.kind, vehicle.options, field="vehicle") if vehicle.id is None else {}
    except InputError as error:
        problems += error.problems
    problems += _mismatch(definition, vehicle.kind, options)
    if problems:
        raise InputError(
            "Invalid campaign.",
            problems=tuple(problems),
            hint="Correct the fields listed, then try again; nothing was changed.",
        )
    return definition, options


def _mismatch(definition: Definition, kind: str, options: Mapping[str, OptionValue]) -> Iterator[Problem]:
    """Problems with the combination of experiment and vehicle. `options` is empty if invalid, and for a registered
    vehicle."""
    if kind not in VEHICLE_KINDS:
        return
    described = VEHICLE_KINDS[kind]
    if definition.experiment not in described.experiments:
        yield Problem("definition.experiment", f"{definition.experiment!r} cannot be flown by {kind}")
        yield Problem("vehicle.kind", f"{kind!r} flies only {', '.join(offered(described.experiments))}")
    elif options and definition.experiment not in (flies := described.experiments_with(options)):
        reason = (
            f"{definition.experiment!r} tunes gains that this vehicle does not have; "
            f"it flies {', '.join(offered(flies))}"
        )
        yield Problem("definition.experiment", reason)
    elif (
        excess_m := highest_set_point_m(definition, EXPERIMENTS.get(definition.experiment))
        - described.highest_set_point_m
    ) > 0.0:
        yield Problem(
            "definition.experiment_options.height_m",
            f"must be lower by {excess_m:g} m, or the steps smaller: a vehicle of this kind flies "
            f"to at most {described.highest_set_point_m:g} m",
        )


def fill_in_donor(session: Session, asked: DefinitionIn) -> DefinitionIn:
    """Return the definition with the donor's trial number, checksum and gains filled in; unchanged without a donor.

    The donor is the best flight with the best gains of its campaign unless a trial is named. Its record and gains are
    fixed from then on, whatever class the trial gets later. Raises InputError when there is no such flight, it belongs
    to another experiment or was scored otherwise, or its record does not match the checksum in the definition.
    """
    named = asked.start.donor
    if named is None or asked.start.kind != "campaign":
        return asked
    trial = _trial(session, asked, named)
    assert trial.trajectory is not None
    checksum = trial.trajectory.checksum
    if named.checksum and named.checksum != checksum:
        raise _refused("checksum", f"does not match the record of flight {trial.number}; leave it out")
    donor = Donor(campaign_id=named.campaign_id, trial_number=trial.number, checksum=checksum)
    return asked.model_copy(update={"start": Start(kind="campaign", gains=dict(trial.gains), donor=donor)})


def _trial(session: Session, asked: DefinitionIn, named: Donor) -> TrialRow:
    try:
        campaign = repository.get_campaign(session, named.campaign_id)
    except NotFoundError as error:
        raise _refused("campaign_id", f"there is no campaign {named.campaign_id}") from error
    if campaign.experiment != asked.experiment:
        reason = f"campaign {campaign.id} flies {campaign.experiment!r}, this one {asked.experiment!r}"
        raise _refused("campaign_id", reason)
    if (difference := _other_score(campaign, asked)) is not None:
        raise _refused("campaign_id", difference)
    trials = history.trials_of(session, campaign.id)
    if named.trial_number is None:
        now = flown_evidence(campaign, trials)
        best = now.winner.numbers if now.groups else ()
        found = history.best_of([row for row in trials if row.number in best])
    else:
        found = next((row for row in trials if row.number == named.trial_number), None)
    if found is None or found.trajectory is None or (not named.checksum and found.state != TrialState.VALID):
        which = "flight" if named.trial_number is None else f"flight {named.trial_number}"
        raise _refused("trial_number", f"campaign {campaign.id} has no valid {which}")
    return found


def _other_score(campaign: CampaignRow, asked: DefinitionIn) -> str | None:
    """Why the campaign's flights cannot be compared with those of the definition, which has the same experiment; None
    if both are scored alike, and for options that the definition's own check refuses."""
    experiment = get_experiment(campaign.experiment)
    chosen = asked.experiment_options
    if any(problems_of_options(chosen, experiment.options, field="experiment_options", owner=experiment.name)):
        return None
    theirs, own = experiment_of_campaign(campaign), experiment.configured(chosen)
    if theirs.measure != own.measure:
        return f"campaign {campaign.id} flies {theirs.measure}, this one {own.measure}"
    if theirs.window_s != own.window_s:
        return f"campaign {campaign.id} has a scored window of {theirs.window_s:g} s, this one of {own.window_s:g} s"
    return None


def _refused(field: str, reason: str) -> InputError:
    return InputError(
        "This campaign cannot start from the given campaign.",
        problems=(Problem(f"definition.start.donor.{field}", reason),),
        hint="Choose a campaign of the same experiment and window with a valid flight, or another start.",
    )
