"""API views of vehicles, their acts and their gain history; what a vehicle can do, by its kind."""

from collections.abc import Sequence
from functools import partial
from typing import Final

from sqlalchemy.orm import Session

from app.common.conflict_checks import allowed
from app.common.schemas import OptionValue, Page, decode_cursor, encode_cursor
from app.common.states import (
    ACTIVE_ACT_STATES,
    ACTIVE_FLIGHT_STATES,
    FLIGHT_COMMANDS,
    FLOWN_FLIGHT_STATES,
    VEHICLE_ACTIONS,
    ActKind,
    ActState,
    FlightState,
    TrialState,
    VehicleState,
)
from app.db.models import CampaignRow, FlightRow, VehicleActRow, VehicleRow
from app.db.pages import Order, page_of
from app.fleet import repository
from app.fleet.control import control_of
from app.fleet.schemas import CampaignVehicle, GivenGains, Vehicle, VehicleAct
from app.vehicles.flight_end import end_text
from app.vehicles.kinds import VehicleKind
from app.vehicles.registry import VEHICLE_KINDS


def can_fly(row: VehicleRow) -> bool:
    """Whether the program can fly it, rather than import records of flights flown elsewhere."""
    kind = VEHICLE_KINDS.get(row.kind)
    return kind is not None and kind.can_fly


def experiments_of(row: VehicleRow) -> list[str]:
    """Experiments whose gains the vehicle has; for a shared vehicle, all that its kind can fly."""
    kind = VEHICLE_KINDS.get(row.kind)
    if kind is None:
        return []
    return list(kind.experiments_with(row.options) if row.registered else kind.experiments)


def settings_of(row: VehicleRow) -> dict[str, OptionValue]:
    """The settings of a registered vehicle, with defaults filled in."""
    kind = VEHICLE_KINDS.get(row.kind)
    return dict(row.options) if kind is None else kind.completed(row.options)


def is_registered_one_by_one(kind: VehicleKind) -> bool:
    """Whether each vehicle of the kind has its own row, settings and link, rather than one shared by all campaigns.

    True for kinds that include real vehicles and that the program flies.
    """
    return kind.is_real and kind.can_fly


def needs_staging(row: VehicleRow) -> bool:
    """Whether a person's own act is required between staging and takeoff: the vehicle is real and registered."""
    return row.is_real and row.registered


_OF_SHARED: Final = frozenset({"fly", "release"})
_NEWEST_FIRST: Final = "-at"


def vehicle_view(row: VehicleRow) -> Vehicle:
    return Vehicle.view_of(
        row,
        can_fly=can_fly(row),
        experiments=experiments_of(row),
        options=settings_of(row) if row.registered else row.options,
        control=control_of(row),
        actions=_actions(row),
    )


def campaign_vehicle(row: CampaignRow) -> CampaignVehicle:
    """A campaign's vehicle with its settings."""
    vehicle = row.vehicle
    return CampaignVehicle.view_of(
        vehicle, can_fly=can_fly(vehicle), needs_staging=needs_staging(vehicle), options=options_of(row)
    )


def options_of(row: CampaignRow) -> dict[str, OptionValue]:
    """The settings that a campaign flies with: a registered vehicle's own, else the campaign's."""
    return settings_of(row.vehicle) if row.vehicle.registered else dict(row.vehicle_options)


def act_view(row: VehicleActRow, flight: FlightRow | None = None) -> VehicleAct:
    """The act; with the flight that it is a command of, its outcome follows from that of the flight."""
    act = VehicleAct.model_validate(row, from_attributes=True)
    if flight is None:
        return act
    state, problem = _command_outcome(row.kind, flight)
    finished_at = None if state in ACTIVE_ACT_STATES else act.finished_at
    return act.model_copy(update={"state": state, "problem": problem, "finished_at": finished_at})


def _command_outcome(kind: ActKind, flight: FlightRow) -> tuple[ActState, str]:
    """State of a command of a flight, and why it failed."""
    is_over = flight.state not in ACTIVE_FLIGHT_STATES
    is_done = {
        ActKind.STAGE: flight.read_back == flight.gains,
        ActKind.TAKE_OFF: flight.state in FLOWN_FLIGHT_STATES
        or (not is_over and flight.trial.state == TrialState.FLYING),
        ActKind.UNSTAGE: is_over and flight.restored is not None,
        ActKind.ABORT: is_over and flight.state not in {FlightState.LANDED, FlightState.LOST},
    }[kind]
    if is_done:
        return ActState.DONE, ""
    if is_over:
        return ActState.FAILED, end_text(flight.end) or "The flight had ended before."
    return ActState.REQUESTED if flight.state == FlightState.REQUESTED else ActState.RUNNING, ""


def _flight_id(row: VehicleActRow) -> int | None:
    """The flight that an act is a command of; None for other acts."""
    found = (row.result or {}).get("flight_id") if row.kind in FLIGHT_COMMANDS else None
    return found if isinstance(found, int) else None


def acts_view(session: Session, vehicle_id: int, *, limit: int, cursor: str | None) -> Page[VehicleAct]:
    """Page of acts, newest first. Raises NotFoundError."""
    repository.get_one(session, vehicle_id)
    order = Order("-id", VehicleActRow.id.expression, descending=True)
    wanted, view = repository.acts_wanted(vehicle_id), partial(_act_views, session)
    return page_of(session, wanted, order, cursor=cursor, limit=limit, view=view)


def _act_views(session: Session, rows: Sequence[VehicleActRow]) -> list[VehicleAct]:
    of_flights = {row.id: flight_id for row in rows if (flight_id := _flight_id(row)) is not None}
    flights = repository.flights_by_id(session, list(of_flights.values()))
    return [act_view(row, flights.get(of_flights.get(row.id, 0))) for row in rows]


def ledger_view(session: Session, vehicle_id: int, *, limit: int, cursor: str | None) -> Page[GivenGains]:
    """Page of the gain sets that the vehicle was given, newest first. Raises NotFoundError."""
    vehicle = repository.get_one(session, vehicle_id)
    before = None if cursor is None else decode_cursor(_NEWEST_FIRST, cursor, str)
    found, total = repository.ledger(session, vehicle_id, before=before, limit=limit)
    shown = [line for line, _ in found[:limit]]
    of_flights = {"flight", repository.RESTORE_AFTER_FLIGHT}
    flights = repository.flights_by_id(session, [identity for purpose, identity in shown if purpose in of_flights])
    acts = repository.acts_by_id(session, [identity for purpose, identity in shown if purpose not in of_flights])
    items = []
    for purpose, identity in shown:
        if purpose == "flight":
            items.append(_of_flight(flights[identity]))
        elif purpose == repository.RESTORE_AFTER_FLIGHT:
            items.append(_of_restoring(vehicle, flights[identity]))
        else:
            items.append(_of_act(acts[identity]))
    following = encode_cursor(_NEWEST_FIRST, found[limit - 1][1]) if len(found) > limit else None
    return Page(items=items, total=total, next_cursor=following)


def is_linked_or_wanted(row: VehicleRow) -> bool:
    return row.state != VehicleState.DISCONNECTED or row.wanted_connected


def _actions(row: VehicleRow) -> list[str]:
    possible = allowed(VEHICLE_ACTIONS, row.state)
    if not row.registered:
        possible = [action for action in possible if action in _OF_SHARED]
    impossible = set() if can_fly(row) else {"fly", "stage"}
    if needs_staging(row):
        impossible.add("fly")
    if not is_linked_or_wanted(row):
        impossible.add("disconnect")
    if is_linked_or_wanted(row) or row.concern:
        impossible |= {"configure", "delete"}
    return [action for action in possible if action not in impossible]


def _of_flight(row: FlightRow) -> GivenGains:
    return GivenGains.view_of(
        row,
        purpose="flight",
        flight_id=row.id,
        act_id=None,
        asked=row.gains,
        outcome="record invalid" if row.state == FlightState.LANDED and row.trial.ending == "invalid" else row.state,
        asked_at=row.claimed_at,
    )


def _of_restoring(vehicle: VehicleRow, row: FlightRow) -> GivenGains:
    asked = row.safe_gains if row.safe_gains is not None else vehicle.safe_gains
    return GivenGains.view_of(
        row,
        purpose=repository.RESTORE_AFTER_FLIGHT,
        flight_id=row.id,
        act_id=None,
        asked=asked,
        read_back=row.restored,
        outcome="not confirmed" if row.restored is None else "done" if row.restored == asked else "failed",
        asked_at=row.restored_at or row.finished_at,
    )


def _of_act(row: VehicleActRow) -> GivenGains:
    return GivenGains.view_of(
        row,
        purpose=row.kind.value,
        flight_id=None,
        campaign_id=None,
        trial_id=None,
        act_id=row.id,
        asked=row.asked or {},
        outcome=row.state.value,
        asked_at=row.claimed_at,
    )
