"""Operations on campaigns for clients: people and scripts. Proposals are in `proposals`, API views in `views`.

A rehearsal is the same campaign on a simulation, for a campaign on a real vehicle. The best gains become the vehicle's
safe gains once flights have shown that they are better.
"""

import re
from collections.abc import Collection
from functools import partial
from itertools import count
from typing import Final

from sqlalchemy.orm import Session

from app.accounts.permissions import Permission, RequestContext
from app.autopilots.registry import get_experiment
from app.campaigns import history, repository
from app.campaigns.definitions import check_campaign, fill_in_donor, flown_evidence, stored
from app.campaigns.history import cancel_unflown, notify_rehearsed_campaign, set_campaign_state
from app.campaigns.proposals import end_campaign, history_changed, reopen, request_proposal, safe_gains_changed
from app.campaigns.rehearsals import rehearsal_of
from app.campaigns.schemas import (
    Campaign,
    CampaignEdit,
    CampaignSummary,
    Clone,
    Definition,
    Donor,
    NewCampaign,
    NextFlight,
    Promotion,
    Sort,
    Start,
)
from app.campaigns.views import campaign_view, next_flight_view, summaries
from app.common.conflict_checks import check_action, check_version
from app.common.errors import BusyError, ConflictError, InputError, NotFoundError, Problem
from app.common.schemas import LONGEST_NAME, Page
from app.common.states import CAMPAIGN_ACTIONS, CampaignState, Outcome
from app.core.formatting import confidence_text, format_gains, named_flights
from app.db.base import added
from app.db.models import CampaignRow, RehearsalRow
from app.db.pages import Part, page_of
from app.fleet import service as fleet
from app.fleet.control import require_may
from app.fleet.registration import promote_gains
from app.fleet.schemas import Vehicle, VehicleChoice
from app.fleet.service import get_vehicle

_DIGITS_OF_AN_ID: Final = 19


def list_campaigns(
    session: Session,
    part: Part,
    *,
    search: str,
    states: Collection[CampaignState],
    vehicles: Collection[str],
    sort: Sort,
) -> Page[CampaignSummary]:
    """One page of summaries. Raises InputError for a cursor of another list."""
    wanted, order = repository.campaigns_wanted(search, states, vehicles), repository.ORDERS[sort]
    return page_of(session, wanted, order, part, partial(summaries, session))


def get_row(session: Session, campaign_id: int) -> CampaignRow:
    """The campaign's row, for other slices. Raises NotFoundError."""
    return repository.get_campaign(session, campaign_id)


def find_by_id_or_name(session: Session, wanted: str) -> int:
    """Id of the campaign with that id or, ignoring case, that name.

    Raises NotFoundError, and InputError when several have the name.
    """
    if wanted.isdecimal() and len(wanted) < _DIGITS_OF_AN_ID:
        return get_row(session, int(wanted)).id
    found = repository.ids_of_name(session, wanted)
    if not found:
        raise NotFoundError("campaign", repr(wanted), hint="Use its complete name, or the number in its URL.")
    if len(found) > 1:
        raise InputError(
            f"{len(found)} campaigns have the name {wanted!r}.",
            hint="Use the number of the campaign.",
            problems=(Problem("campaign", f"matches {', '.join(map(str, found))}"),),
        )
    return found[0]


def unused_name(session: Session, name: str) -> str:
    """The name, or where a campaign has it already, the name with "(imported)" or "(imported 2)" and so on."""
    suffixes = ("", " (imported)", *(f" (imported {number})" for number in range(2, 1000)))
    shortened = (name[: LONGEST_NAME - len(suffix)] + suffix for suffix in suffixes)
    return next((each for each in shortened if not repository.ids_of_name(session, each)), name)


def get_campaign(session: Session, campaign_id: int) -> Campaign:
    """The campaign with that id. Raises NotFoundError."""
    return campaign_view(session, repository.get_campaign(session, campaign_id))


def create_campaign(session: Session, new: NewCampaign) -> Campaign:
    """Create a draft and request its first proposal. Raises InputError that names every invalid field."""
    return campaign_view(session, add_campaign(session, new.name, new.definition, new.vehicle))


def add_campaign(
    session: Session,
    name: str,
    asked: Definition,
    choice: VehicleChoice,
    *,
    parent_id: int | None = None,
    safe_gains: dict[str, float] | None = None,
    continues: str = "",
) -> CampaignRow:
    """Add a draft and request its first proposal. `continues` is as in `check_campaign`.

    `safe_gains` are given for a rehearsal: those of the vehicle that it is for. Every other campaign gets its own
    vehicle's at its first flight. Raises InputError that names what cannot be used.
    """
    row = CampaignRow(name=name, state=CampaignState.DRAFT, parent_id=parent_id, safe_gains=safe_gains)
    _set_definition(session, row, asked, choice, continues)
    added(session, row)
    request_proposal(session, row)
    return row


def _name_of_clone(session: Session, name: str) -> str:
    """`Twin (2)` for a clone of `Twin`, or the next number that no campaign has."""
    base = re.sub(r" \(\d+\)$", "", name)[:110]
    taken = repository.names_beginning(session, base)
    numbered = (f"{base} ({number})" for number in count(2))
    return next(one for one in numbered if one not in taken)


def clone_campaign(session: Session, campaign_id: int, clone: Clone) -> Campaign:
    """Create a draft with the same definition, linked to its origin; with `warm_start` it starts from the origin's best
    flight."""
    origin = repository.get_campaign(session, campaign_id)
    vehicle = clone.vehicle or _choice_of(origin)
    name = clone.name or _name_of_clone(session, origin.name)
    definition = _definition_for(origin, vehicle)
    if clone.warm_start:
        definition = definition.model_copy(update={"start": Start(kind="campaign", donor=Donor(campaign_id=origin.id))})
    return campaign_view(session, add_campaign(session, name, definition, vehicle, parent_id=origin.id))


def _get_permitted(session: Session, campaign_id: int, context: RequestContext) -> CampaignRow:
    """The campaign, to be changed. Raises NotAllowedError for one on a real vehicle when the client lacks the key."""
    row = repository.get_campaign(session, campaign_id)
    require_may(Permission.REVIEW, row.vehicle, context)
    return row


def edit_campaign(session: Session, campaign_id: int, edit: CampaignEdit, context: RequestContext) -> Campaign:
    """Change a campaign. Raises ConflictError when another client changed it first, or when its definition is
    frozen; NotAllowedError as `_get_permitted`."""
    row = _get_permitted(session, campaign_id, context)
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


def delete_campaign(session: Session, campaign_id: int, version: int, context: RequestContext) -> None:
    """Delete a campaign.

    Raises ConflictError when a flight was begun in it, or another client has changed it meanwhile.
    """
    row = _get_permitted(session, campaign_id, context)
    check_version(version, row.version, f"Campaign {row.id}", {})
    check_action(CAMPAIGN_ACTIONS, "delete", row.state, f"Campaign {row.id}")
    _require_no_flight(session, row)
    if repository.has_claimed_flight(session, row.id):
        raise ConflictError(
            f"Campaign {row.id} is in the gain history of {row.vehicle.title}, because one of its flights was started.",
            hint="It cannot be deleted: the gain history keeps every gain set that was written to a vehicle.",
        )
    repository.delete_unclaimed_flights(session, row.id)
    curves = repository.predicted_curves(session, row.id)
    session.delete(row)
    session.flush()
    for curve in curves:
        session.delete(curve)


def finish_campaign(session: Session, campaign_id: int, reason: str, context: RequestContext) -> Campaign:
    """Finish a campaign on the operator's decision. Raises ConflictError unless it is between flights."""
    row = _get_permitted(session, campaign_id, context)
    check_action(CAMPAIGN_ACTIONS, "finish", row.state, f"Campaign {row.id}")
    _require_no_flight(session, row)
    end_campaign(session, row, Outcome.STOPPED, reason)
    return campaign_view(session, row)


def reopen_campaign(session: Session, campaign_id: int, flights: int, context: RequestContext) -> Campaign:
    """Reopen a finished campaign for this many more flights. Raises ConflictError unless it is finished, and for a
    rehearsal, because its result lets another campaign fly."""
    row = _get_permitted(session, campaign_id, context)
    check_action(CAMPAIGN_ACTIONS, "reopen", row.state, f"Campaign {row.id}")
    if (rehearsed := repository.rehearsed_id(session, row.id)) is not None:
        raise ConflictError(
            f"Campaign {row.id} is the rehearsal of campaign {rehearsed}, which depends on its result.",
            hint="Clone it to fly more.",
        )
    reopen(row)
    row.open_until_flight = len(history.in_history(history.trials_of(session, row.id))) + flights
    history_changed(session, row)
    return campaign_view(session, row)


def archive_campaign(session: Session, campaign_id: int, context: RequestContext) -> Campaign:
    """Archive a campaign. Raises ConflictError unless it is finished."""
    row = _get_permitted(session, campaign_id, context)
    check_action(CAMPAIGN_ACTIONS, "archive", row.state, f"Campaign {row.id}")
    set_campaign_state(row, CampaignState.ARCHIVED)
    return campaign_view(session, row)


def next_flight(session: Session, campaign_id: int) -> NextFlight:
    """State of the next proposal. Raises NotFoundError."""
    return next_flight_view(session, repository.get_campaign(session, campaign_id))


def compute_proposal(session: Session, campaign_id: int) -> NextFlight:
    """Request the proposal again. Raises ConflictError in states without proposals."""
    row = repository.get_campaign(session, campaign_id)
    check_action(CAMPAIGN_ACTIONS, "propose", row.state, f"Campaign {row.id}")
    request_proposal(session, row)
    return next_flight_view(session, row)


def _definition_for(row: CampaignRow, vehicle: VehicleChoice) -> Definition:
    """The campaign's definition for this vehicle: for another than its own without a log, which tells only of the
    vehicle that flew it."""
    definition = Definition.model_validate(row.definition)
    if vehicle == _choice_of(row):
        return definition
    return definition.model_copy(update={"start": definition.start.model_copy(update={"log": None})})


def _choice_of(row: CampaignRow) -> VehicleChoice:
    vehicle = row.vehicle
    if vehicle.registered:
        return VehicleChoice(kind=vehicle.kind, id=vehicle.id)
    return VehicleChoice(kind=vehicle.kind, options=row.vehicle_options)


def _set_definition(
    session: Session, row: CampaignRow, asked: Definition, choice: VehicleChoice, continues: str
) -> None:
    """Check what the campaign flies, on which vehicle, and set both."""
    definition, options = check_campaign(fill_in_donor(session, asked), choice, continues=continues)
    space = get_experiment(definition.experiment).space
    row.vehicle = fleet.chosen_vehicle(session, choice, default_gains=space.mapping(space.default))
    row.experiment, row.strategy = definition.experiment, definition.strategy
    row.definition, row.vehicle_options = stored(definition), options


def _define(session: Session, row: CampaignRow, edit: CampaignEdit) -> None:
    check_action(CAMPAIGN_ACTIONS, "define", row.state, f"Campaign {row.id}")
    _require_no_flight(session, row)
    vehicle = edit.vehicle or _choice_of(row)
    asked = edit.definition or _definition_for(row, vehicle)
    _set_definition(session, row, asked, vehicle, row.experiment)
    if row.vehicle.is_real:  # it gets the safe gains of its own vehicle; a rehearsal had those of another
        row.safe_gains = None
    cancel_unflown(history.trials_of(session, row.id), None, "the campaign's definition was changed")
    request_proposal(session, row)


def _require_no_flight(session: Session, row: CampaignRow) -> None:
    if (flight := history.flight_under_way(session, row.id)) is not None:
        raise BusyError(
            f"Flight {flight.trial.number} of this campaign is in progress.",
            hint="Wait until it has ended, or abort it.",
        )


def promote_best(session: Session, campaign_id: int, asked: Promotion, context: RequestContext) -> Vehicle:
    """Make the best gains the vehicle's safe gains; the act that records this names the flights.

    Raises ConflictError while the best gains are not shown to be better than the first ones, and when the vehicle is
    shared, not at rest, under another operator's control, or was changed meanwhile.
    """
    row = repository.get_campaign(session, campaign_id)
    now = flown_evidence(row, history.trials_of(session, campaign_id)).within_bounds
    if now.comparison is None:
        raise ConflictError(
            "The best gains so far are the first flight's. Only gains that are shown to be better than these can "
            "become the safe gains.",
            hint="Fly other gains first.",
        )
    compared = now.comparison
    if compared.verdict != "better":
        raise ConflictError(
            f"The best gains cannot become the safe gains: the comparison of {format_gains(now.winner.gains)} with the "
            f"first gains is {compared.verdict}.",
            hint="Fly the best gains and the first gains again until the verdict is “better”.",
        )
    assert compared.confidence is not None
    gains, sure = dict(now.winner.gains), confidence_text(compared.confidence)
    because = f"{asked.statement} (campaign {row.id}, {named_flights(now.winner.numbers)}: better, {sure} confidence)"
    promote_gains(session, row.vehicle, gains, version=asked.version, reason=because, context=context)
    safe_gains_changed(session, row.vehicle_id)
    return get_vehicle(session, row.vehicle_id)


def rehearse(session: Session, campaign_id: int) -> Campaign:
    """Return the rehearsal of this campaign: the one that is under way or passed, else a new draft on a simulation with
    the same definition and safe gains.

    Raises ConflictError where no rehearsal is needed, and where no simulation can fly the experiment.
    """
    row = repository.get_campaign(session, campaign_id)
    existing = rehearsal_of(session, row)
    if existing.state == "not needed":
        why = existing.reason or f"{row.vehicle.name} is not a real vehicle flown from here"
        raise ConflictError(f"Campaign {row.id} needs no rehearsal: {why}.", hint="Fly it.")
    if existing.campaign_id is not None and existing.state != "failed":
        return campaign_view(session, repository.get_campaign(session, existing.campaign_id))
    simulation = fleet.simulation_for(session, row.experiment, row.vehicle.safe_gains)
    if simulation is None:
        raise ConflictError(
            f"No registered simulated drone flies “{get_experiment(row.experiment).title}”.",
            hint="Register a simulated drone of the same autopilot (`gainline sim-drone`), connect it, then rehearse.",
        )
    made = add_campaign(
        session,
        f"Rehearsal: {row.name[:100]}",
        Definition.model_validate(row.definition),
        simulation,
        parent_id=row.id,
        safe_gains=dict(row.vehicle.safe_gains if row.safe_gains is None else row.safe_gains),
        continues=row.experiment,
    )
    added(session, RehearsalRow(rehearsal_id=made.id, campaign_id=row.id))
    notify_rehearsed_campaign(session, made)
    return campaign_view(session, made)
