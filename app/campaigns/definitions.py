"""A campaign's definition on its way from a request to the core, into its row, and back."""

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from typing import Final

from pydantic import TypeAdapter

from app.campaigns.schemas import Definition as DefinitionIn
from app.core.checking import check_definition
from app.core.definition import Definition
from app.core.errors import InputError, Problem
from app.core.experiments import get_experiment
from app.db.models import CampaignRow, JsonObject
from app.fleet.schemas import VehicleChoice
from app.vehicles.base import OptionValue
from app.vehicles.open import VEHICLE_KINDS, check_options

_ADAPTER: Final = TypeAdapter(Definition)


def core_definition(asked: DefinitionIn) -> Definition:
    """The same definition as the core has it, unchecked."""
    return _ADAPTER.validate_python(asked.model_dump())


def definition_of(row: CampaignRow) -> Definition:
    """The definition of a stored campaign, with its vehicle's safe gains where they are not the experiment's own."""
    space = get_experiment(row.experiment).space
    own = dict(row.vehicle.safe_gains)
    safe_gains = None if own == space.mapping(space.default) else own
    return replace(_ADAPTER.validate_python(row.definition), safe_gains=safe_gains)


def frozen_digest(row: CampaignRow) -> str:
    """SHA-256 over all that is frozen at the first flight: the definition, the vehicle with all its settings, and its
    safe gains. Proposals carry the narrower digest of the definition, because they depend on nothing else."""
    frozen = {
        "definition": definition_of(row).digest(),
        "vehicle": row.vehicle.kind,
        "options": row.vehicle_options,
        "safe_gains": row.vehicle.safe_gains,
    }
    return hashlib.sha256(json.dumps(frozen, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def stored(definition: Definition) -> JsonObject:
    """For the row; safe gains are the vehicle's."""
    return {name: value for name, value in asdict(definition).items() if name != "safe_gains"}


def check_campaign(asked: DefinitionIn, vehicle: VehicleChoice) -> tuple[Definition, dict[str, OptionValue]]:
    """Definition and complete vehicle options. Raises InputError naming everything that cannot be used in either."""
    _require_whole(asked)
    definition = core_definition(asked)
    options: dict[str, OptionValue] = {}

    def take_options() -> None:
        options.update(check_options(vehicle.kind, vehicle.options, field="vehicle"))

    problems = [
        *_refusals(lambda: check_definition(definition), "definition."),
        *_refusals(take_options, ""),
        *_mismatch(definition, vehicle.kind),
    ]
    if problems:
        raise InputError(
            "This campaign cannot be used.",
            problems=tuple(problems),
            hint="Correct the named fields and send it again; nothing was changed.",
        )
    return definition, options


def _require_whole(asked: DefinitionIn) -> None:
    donor = asked.start.donor
    if donor is not None and donor.trial_number is None:
        raise InputError(
            "This campaign cannot be used.",
            problems=(Problem("definition.start.donor", "goes with start.kind 'campaign' only"),),
            hint="Leave the donor out, or start from its campaign.",
        )


def _mismatch(definition: Definition, kind: str) -> Iterator[Problem]:
    if kind in VEHICLE_KINDS and definition.experiment not in (flies := VEHICLE_KINDS[kind].experiments):
        yield Problem("definition.experiment", f"{definition.experiment!r} cannot be flown by {kind}")
        yield Problem("vehicle.kind", f"{kind!r} flies {', '.join(flies)} only")


def _refusals(check: Callable[[], None], prefix: str) -> list[Problem]:
    try:
        check()
    except InputError as error:
        return [Problem(prefix + problem.field, problem.reason) for problem in error.problems]
    return []
