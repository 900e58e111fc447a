"""Import of a checked bundle: stores it as rows with new ids; every number and time is unchanged."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session

from app.autopilots.registry import EXPERIMENTS
from app.bundles.contents import CONTENTS, Campaign, Record, Trial
from app.bundles.reader import Bundle, refusal, trajectory_row
from app.campaigns import history
from app.campaigns import service as campaigns
from app.campaigns.definitions import core_definition
from app.campaigns.proposals import is_stale, request_proposal
from app.campaigns.schemas import Campaign as CampaignView
from app.campaigns.schemas import Definition
from app.common.data_folder import log_of_trial
from app.common.errors import ConflictError, Problem
from app.core.tuning.definition_checks import problems_of
from app.db.base import JsonObject, added, utc_now
from app.db.models import CampaignRow, ProposalRow, TrajectoryRow, TrialPhotoRow, TrialRow, VehicleRow
from app.fleet import service as fleet
from app.fleet.registration import get_or_create_imported_vehicle
from app.fleet.schemas import VehicleChoice
from app.vehicles.registry import VEHICLE_KINDS, check_options

_SET_HERE: Final = {"id", "name", "definition", "safe_gains", "vehicle", "vehicle_options", "trials", "proposals"}
"""Fields of a campaign that are not stored as they came."""
_AT_ONCE_BYTES: Final = 16 * 2**20
_OTHER_VERSION: Final = "Import it with the version of Gainline that wrote it, or update this installation."


def _campaign(session: Session, where: str, source: Campaign, new_ids: Mapping[int, int]) -> CampaignRow:
    definition = _definition(where, source.definition, new_ids)
    vehicle, options = _vehicle(session, where, source)
    row = CampaignRow(
        name=campaigns.unused_name(session, source.name),
        experiment=definition["experiment"],
        strategy=definition["strategy"],
        definition=definition,
        safe_gains=source.safe_gains or (source.vehicle.safe_gains if source.vehicle.registered else None),
        vehicle=vehicle,
        vehicle_options=options,
        updated_at=utc_now(),
        **source.values_without(_SET_HERE),
    )
    return added(session, row)


def _definition(where: str, source: JsonObject, new_ids: Mapping[int, int]) -> JsonObject:
    """The definition with the new id of the campaign that it starts from."""
    donor = (source.get("start") or {}).get("donor")
    if donor is not None:
        if donor["campaign_id"] not in new_ids:
            raise refusal(
                Problem(f"{where}.definition.start.donor.campaign_id", "names a campaign that is not in the bundle"),
                hint=_OTHER_VERSION,
            )
        source = deepcopy(source)
        source["start"]["donor"]["campaign_id"] = new_ids[donor["campaign_id"]]
    if wrong := problems_of(core_definition(Definition.model_validate(source)), EXPERIMENTS):
        raise refusal(Problem(f"{where}.definition.{wrong[0].field}", wrong[0].reason), hint=_OTHER_VERSION)
    return source


def _vehicle(session: Session, where: str, source: Campaign) -> tuple[VehicleRow, JsonObject]:
    """The vehicle's row and options: a simulation as it is, a placeholder for a registered vehicle, whatever its
    name."""
    vehicle = source.vehicle
    if vehicle.registered:
        row = get_or_create_imported_vehicle(
            session, name=vehicle.name, kind=vehicle.kind, is_real=vehicle.is_real, safe_gains=vehicle.safe_gains
        )
        return row, {}
    if vehicle.kind not in VEHICLE_KINDS:
        raise refusal(
            Problem(f"{where}.vehicle.kind", f"{vehicle.kind!r} is not supported by this version"), hint=_OTHER_VERSION
        )
    options = check_options(vehicle.kind, source.vehicle_options, field=f"{where}.vehicle")
    choice = VehicleChoice(kind=vehicle.kind, options=options)
    return fleet.chosen_vehicle(session, choice, default_gains=vehicle.safe_gains), options


def _trials(
    session: Session, bundle: Bundle, campaign: CampaignRow, sources: Sequence[Trial], proposals: Sequence[ProposalRow]
) -> list[TrialRow]:
    """Store trials in large batches, because other writers wait meanwhile, but limited by memory."""
    made: list[TrialRow] = []
    waiting: list[TrajectoryRow | TrialPhotoRow] = []
    size = 0
    for each in sources:
        row = TrialRow(
            campaign_id=campaign.id,
            proposal_id=None if each.proposal is None else proposals[each.proposal].id,
            trajectory=_record(bundle, each.record),
            predicted=_record(bundle, each.predicted),
            curve=None if each.curve is None else [list(point) for point in each.curve],
            **each.values_without({"proposal", "record", "predicted", "photos", "telemetry", "curve"}),
        )
        photos = [
            TrialPhotoRow(trial=row, media_type=one.media_type, data=bundle.part(one.part), added_at=one.added_at)
            for one in each.photos
        ]
        session.add_all((row, *photos))
        made.append(row)
        held: list[TrajectoryRow | TrialPhotoRow] = [*photos, *filter(None, (row.trajectory, row.predicted))]
        waiting += held
        size += sum(len(one.data) for one in held)
        if size > _AT_ONCE_BYTES:
            _settle(session, waiting)
            size = 0
    _settle(session, waiting)
    return made


def _settle(session: Session, waiting: list[TrajectoryRow | TrialPhotoRow]) -> None:
    """Flush the waiting rows and release their data."""
    session.flush()
    for one in waiting:
        session.expire(one, ["data"])
    waiting.clear()


def _record(bundle: Bundle, source: Record | None) -> TrajectoryRow | None:
    return None if source is None else trajectory_row(source, bundle.part(source.part))


def store_bundle(session: Session, bundle: Bundle, data_dir: Path) -> CampaignView:
    """Import a checked bundle: a new campaign, and those that it starts from.

    Raises InputError if this version does not support the content, and ConflictError while any flight is active,
    because a large bundle holds the write lock for longer than a flight may wait.
    """
    if (flight := history.flight_under_way(session)) is not None:
        raise ConflictError(
            f"Campaign {flight.campaign_id} has a flight requested, staged or under way. Storing a bundle now would "
            "delay its commands and its record.",
            hint="Import the bundle after it has landed, or unstage it.",
        )
    new_ids, telemetry = dict[int, int](), dict[int, str]()
    for place, campaign in enumerate(bundle.contents.campaigns):
        row = _campaign(session, f"{CONTENTS}: campaigns.{place}", campaign, new_ids)
        new_ids[campaign.id] = row.id
        proposals = [
            added(
                session,
                ProposalRow(
                    campaign_id=row.id, predicted=_record(bundle, each.predicted), **each.values_without({"predicted"})
                ),
            )
            for each in campaign.proposals
        ]
        made = _trials(session, bundle, row, campaign.trials, proposals)
        telemetry |= {
            new.id: trial.telemetry for new, trial in zip(made, campaign.trials, strict=True) if trial.telemetry
        }
        if not proposals or is_stale(session, row, proposals[-1], history.trials_of(session, row.id)):
            request_proposal(session, row)  # stale under the new ids; the result has the same gains
    for trial_id, part in telemetry.items():  # beside those of local flights
        file = log_of_trial(data_dir, trial_id)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(bundle.part(part))
    return campaigns.get_campaign(session, new_ids[bundle.contents.campaigns[-1].id])
