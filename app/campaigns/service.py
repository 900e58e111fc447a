"""Operations on campaigns for clients: people and scripts. Proposals are in `proposing`, API views in `views`."""

from collections.abc import Collection
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import repository
from app.campaigns.definitions import check_campaign, frozen_digest, stored
from app.campaigns.donors import fill_in_donor
from app.campaigns.proposing import cancel_outdated, end_campaign, request_proposal, set_campaign_state
from app.campaigns.rehearsals import notify_rehearsed_campaign
from app.campaigns.schemas import (
    Campaign,
    CampaignEdit,
    CampaignSummary,
    Clone,
    Definition,
    Donor,
    NewCampaign,
    NextFlight,
    Sort,
    Start,
)
from app.campaigns.views import campaign_view, next_flight_view, summaries
from app.common.errors import BusyError, ConflictError, InputError, NotFoundError, Problem
from app.common.schemas import OptionValue, Page, decode_cursor, encode_cursor
from app.common.state_machine import check_action, check_version
from app.common.states import CAMPAIGN_ACTIONS, CampaignState, Outcome
from app.core.definition import Definition as CoreDefinition
from app.core.experiments import get_experiment
from app.db.models import CampaignRow, VehicleRow
from app.db.types import utc_now
from app.fleet import service as fleet
from app.fleet.schemas import VehicleChoice
from app.trials import history
from app.trials.lifecycle import cancel_unflown

_DIGITS_OF_AN_ID: Final = 19


def list_campaigns(
    session: Session,
    *,
    search: str,
    states: Collection[CampaignState],
    vehicles: Collection[str],
    sort: Sort,
    limit: int,
    cursor: str | None,
) -> Page[CampaignSummary]:
    """One page of summaries. Raises InputError for a cursor of another list."""
    after = None if cursor is None else decode_cursor(sort, cursor, repository.cursor_kind(sort))
    found, total = repository.page(
        session, search=search, states=states, vehicles=vehicles, sort=sort, after=after, limit=limit
    )
    following = encode_cursor(sort, found[limit - 1][1]) if len(found) > limit else None
    return Page(items=summaries(session, [row for row, _ in found[:limit]]), total=total, next_cursor=following)


def get_row(session: Session, campaign_id: int) -> CampaignRow:
    """The campaign's row, for other slices. Raises NotFoundError."""
    return repository.get_one(session, campaign_id)


def find_by_id_or_name(session: Session, wanted: str) -> int:
    """Id of the campaign with that id or, ignoring case, that name.

    Raises NotFoundError, and InputError when several have the name.
    """
    if wanted.isdecimal() and len(wanted) < _DIGITS_OF_AN_ID:
        return get_row(session, int(wanted)).id
    found = repository.ids_of_name(session, wanted)
    if not found:
        raise NotFoundError("campaign", repr(wanted), hint="Give its whole name, or the number in its address.")
    if len(found) > 1:
        raise InputError(
            f"{len(found)} campaigns are called {wanted!r}.",
            hint="Say which one is meant, by its number.",
            problems=(Problem("campaign", f"may be {', '.join(map(str, found))}"),),
        )
    return found[0]


def get_campaign(session: Session, campaign_id: int) -> Campaign:
    """The campaign with that id. Raises NotFoundError."""
    return campaign_view(session, repository.get_one(session, campaign_id))


def create_campaign(session: Session, new: NewCampaign) -> Campaign:
    """Create a draft and request its first proposal. Raises InputError that names every invalid field."""
    row = add_campaign(session, new.name, new.definition, new.vehicle, parent_id=None)
    return campaign_view(session, row)


def add_campaign(
    session: Session,
    name: str,
    asked: Definition,
    choice: VehicleChoice,
    *,
    parent_id: int | None,
    safe_gains: dict[str, float] | None = None,
) -> CampaignRow:
    """Add a draft and request its first proposal.

    `safe_gains` are given for a rehearsal: those of the vehicle that it is for. Every other campaign gets its own
    vehicle's at its first flight. Raises InputError that names what cannot be used.
    """
    definition, options, vehicle = _checked(session, asked, choice)
    row = CampaignRow(
        name=name,
        state=CampaignState.DRAFT,
        experiment=definition.experiment,
        strategy=definition.strategy,
        definition=stored(definition),
        vehicle=vehicle,
        vehicle_options=options,
        parent_id=parent_id,
        safe_gains=safe_gains,
    )
    session.add(row)
    session.flush()
    request_proposal(session, row)
    return row


def clone_campaign(session: Session, campaign_id: int, clone: Clone) -> Campaign:
    """Create a draft with the same definition, linked to its origin; with `warm_start` it starts from the origin's best
    flight."""
    origin = repository.get_one(session, campaign_id)
    vehicle = clone.vehicle or _choice_of(origin)
    name = clone.name or f"{origin.name[:110]} (again)"
    definition = Definition.model_validate(origin.definition)
    if clone.warm_start:
        definition = definition.model_copy(update={"start": Start(kind="campaign", donor=Donor(campaign_id=origin.id))})
    row = add_campaign(session, name, definition, vehicle, parent_id=origin.id)
    return campaign_view(session, row)


def edit_campaign(session: Session, campaign_id: int, edit: CampaignEdit) -> Campaign:
    """Change a campaign. Raises ConflictError when another client changed it first, or when its definition is
    frozen."""
    row = repository.get_one(session, campaign_id)
    definition = None if edit.definition is None else edit.definition.model_dump(mode="json")
    check_version(
        edit.version,
        row.version,
        f"Campaign {row.id}",
        {
            field: (now, sent)
            for field, now, sent in (
                ("name", row.name, edit.name),
                ("definition", row.definition, definition),
                ("vehicle.kind", row.vehicle.kind, edit.vehicle.kind if edit.vehicle else None),
                ("vehicle.id", row.vehicle.id, edit.vehicle.id if edit.vehicle else None),
            )
            if sent is not None
        },
    )
    if edit.definition is not None or edit.vehicle is not None:
        _define(session, row, edit)
    if edit.name is not None:
        row.name = edit.name
    if edit.model_fields_set > {"version"}:
        row.version += 1
    return campaign_view(session, row)


def delete_campaign(session: Session, campaign_id: int, version: int) -> None:
    """Delete a campaign.

    Raises ConflictError when a flight was begun in it, or another client has changed it meanwhile.
    """
    row = repository.get_one(session, campaign_id)
    check_version(version, row.version, f"Campaign {row.id}", {})
    check_action(CAMPAIGN_ACTIONS, "delete", row.state, f"Campaign {row.id}")
    _require_no_flight(session, row)
    if history.has_begun_flight(session, row.id):
        raise ConflictError(
            f"Campaign {row.id} stands in the ledger of {row.vehicle.title}: a flight was begun in it.",
            hint="Keep it; the ledger lists every gain set that a vehicle was given, for ever.",
        )
    history.drop_unbegun_flights(session, row.id)
    predicted = [proposal.predicted for proposal in repository.proposals(session, row.id) if proposal.predicted]
    session.delete(row)
    session.flush()
    for trajectory in predicted:
        session.delete(trajectory)


def finish_campaign(session: Session, campaign_id: int, reason: str) -> Campaign:
    """Finish a campaign on the operator's decision. Raises ConflictError unless it is between flights."""
    row = repository.get_one(session, campaign_id)
    check_action(CAMPAIGN_ACTIONS, "finish", row.state, f"Campaign {row.id}")
    _require_no_flight(session, row)
    end_campaign(session, row, Outcome.STOPPED, reason)
    return campaign_view(session, row)


def archive_campaign(session: Session, campaign_id: int) -> Campaign:
    """Archive a campaign. Raises ConflictError unless it is finished."""
    row = repository.get_one(session, campaign_id)
    check_action(CAMPAIGN_ACTIONS, "archive", row.state, f"Campaign {row.id}")
    set_campaign_state(row, CampaignState.ARCHIVED)
    return campaign_view(session, row)


def next_flight(session: Session, campaign_id: int) -> NextFlight:
    """State of the next proposal. Raises NotFoundError."""
    return next_flight_view(session, repository.get_one(session, campaign_id))


def compute_proposal(session: Session, campaign_id: int) -> NextFlight:
    """Request the proposal again. Raises ConflictError in states without proposals."""
    row = repository.get_one(session, campaign_id)
    check_action(CAMPAIGN_ACTIONS, "propose", row.state, f"Campaign {row.id}")
    request_proposal(session, row)
    return next_flight_view(session, row)


def start_flying(row: CampaignRow) -> None:
    """Enter state flying, at a lift-off or an imported record; at the first one the definition is frozen."""
    if row.definition_digest is None:
        row.safe_gains = row.safe_gains or dict(row.vehicle.safe_gains)
        row.definition_digest = frozen_digest(row)
    set_campaign_state(row, CampaignState.FLYING)


def finish_flying(session: Session, row: CampaignRow) -> None:
    """Leave state flying once the trial has ended, however it ended, and request the next proposal."""
    if row.state == CampaignState.FLYING:
        set_campaign_state(row, CampaignState.DECIDING)
    history_changed(session, row)


def history_changed(session: Session, row: CampaignRow) -> None:
    """Update everything computed from the flights, after a change of which flights count."""
    row.updated_at = utc_now()
    notify_rehearsed_campaign(session, row)
    cancel_outdated(session, row)
    request_proposal(session, row)


def safe_gains_changed(session: Session, vehicle_id: int) -> None:
    """Request new proposals for the vehicle's unflown campaigns, which start from its safe gains."""
    for row in repository.unflown_on(session, vehicle_id):
        cancel_outdated(session, row)
        request_proposal(session, row)


def _choice_of(row: CampaignRow) -> VehicleChoice:
    vehicle = row.vehicle
    if vehicle.registered:
        return VehicleChoice(kind=vehicle.kind, id=vehicle.id)
    return VehicleChoice(kind=vehicle.kind, options=row.vehicle_options)


def _checked(
    session: Session, asked: Definition, choice: VehicleChoice
) -> tuple[CoreDefinition, dict[str, OptionValue], VehicleRow]:
    """The checked definition, the campaign's own vehicle options (none for a registered vehicle), and the vehicle."""
    definition, options = check_campaign(fill_in_donor(session, asked), choice)
    space = get_experiment(definition.experiment).space
    vehicle = fleet.chosen_vehicle(session, choice, default_gains=space.mapping(space.default))
    return definition, options, vehicle


def _define(session: Session, row: CampaignRow, edit: CampaignEdit) -> None:
    check_action(CAMPAIGN_ACTIONS, "define", row.state, f"Campaign {row.id}")
    _require_no_flight(session, row)
    asked = edit.definition or Definition.model_validate(row.definition)
    definition, options, row.vehicle = _checked(session, asked, edit.vehicle or _choice_of(row))
    row.experiment, row.strategy = definition.experiment, definition.strategy
    row.definition, row.vehicle_options = stored(definition), options
    if row.vehicle.is_real:  # it gets the safe gains of its own vehicle; a rehearsal had those of another
        row.safe_gains = None
    cancel_unflown(history.trials_of(session, row.id), None, "the campaign's definition was changed")
    request_proposal(session, row)


def _require_no_flight(session: Session, row: CampaignRow) -> None:
    if (flight := history.flight_under_way(session, row.id)) is not None:
        raise BusyError(
            f"Campaign {row.id} has a flight under way (trial {flight.trial_id}).",
            hint="Wait until it is over, or abort it.",
        )
