"""Vehicles: who they are, what state they are in, and every gain set that they were given."""

from sqlalchemy.orm import Session

from app.core.policy import Gains
from app.db.models import CampaignRow, VehicleRow
from app.db.paging import decode_cursor, encode_cursor
from app.errors import ConflictError
from app.fleet import repository
from app.fleet.schemas import CampaignVehicle, GivenGains, Vehicle
from app.fleet.states import ACTIONS, MOVES, VehicleState
from app.moves import allowed, check_action, check_move
from app.schemas import Page
from app.vehicles.open import VEHICLE_KINDS, get_kind


def vehicle_of_kind(session: Session, kind: str, *, safe_gains: Gains) -> VehicleRow:
    """The vehicle of that kind; registered with these safe gains when it is the first time that anybody wants it.

    Raises InputError when there is no such kind.
    """
    described = get_kind(kind)
    if (known := repository.of_kind_or_none(session, kind)) is not None:
        return known
    row = VehicleRow(
        kind=kind,
        title=described.title,
        is_real=described.is_real,
        safe_gains=dict(safe_gains),
        state=VehicleState.READY if described.can_fly and described.served else VehicleState.DISCONNECTED,
        concern="",
    )
    session.add(row)
    session.flush()
    return row


def require_ready(row: VehicleRow) -> None:
    """Raises ConflictError when the vehicle cannot be asked to fly."""
    if not can_fly(row):
        raise ConflictError(
            f"{row.title} cannot be flown from here.",
            hint="Fly it elsewhere, then upload the record of the flight to the planned trial.",
        )
    if row.state == VehicleState.QUARANTINED:
        raise ConflictError(
            f"{row.title} is quarantined: {row.concern}", hint="Look at the vehicle, verify its gains, then release it."
        )
    check_action(ACTIONS, "fly", row.state, row.title)


def move_vehicle(row: VehicleRow, to: VehicleState) -> None:
    """Raises ConflictError when the states' table does not lead there."""
    row.state = check_move(MOVES, row.state, to, row.title)


def settle_vehicle(row: VehicleRow, *, concern: str = "") -> None:
    """After a flight, however it ended: ready again, or quarantined when there is a concern."""
    if concern:
        row.concern = concern
    target = VehicleState.QUARANTINED if concern else VehicleState.READY
    if row.state not in {target, VehicleState.QUARANTINED}:
        move_vehicle(row, target)


def can_fly(row: VehicleRow) -> bool:
    """Whether the program can fly it, rather than take records of flights made elsewhere."""
    return row.kind in VEHICLE_KINDS and VEHICLE_KINDS[row.kind].can_fly and VEHICLE_KINDS[row.kind].served


def classed_by_program(row: VehicleRow) -> bool:
    """Whether a complete flight counts without a person's word: simulated ones do, and records sent in from outside."""
    return not row.is_real or not can_fly(row)


def campaign_vehicle(row: CampaignRow) -> CampaignVehicle:
    """A campaign's vehicle with the campaign's settings of it."""
    vehicle = row.vehicle
    return CampaignVehicle(
        id=vehicle.id,
        kind=vehicle.kind,
        title=vehicle.title,
        is_real=vehicle.is_real,
        can_fly=can_fly(vehicle),
        state=vehicle.state,
        options=row.vehicle_options,
    )


def list_vehicles(session: Session, *, limit: int, cursor: str | None) -> Page[Vehicle]:
    """In the order in which they were first wanted."""
    after = 0 if cursor is None else decode_cursor("id", cursor, float)[1]
    rows, total = repository.page(session, after_id=after, limit=limit)
    following = encode_cursor("id", (0, rows[limit - 1].id)) if len(rows) > limit else None
    return Page(items=[_view(row) for row in rows[:limit]], total=total, next_cursor=following)


def get_vehicle(session: Session, vehicle_id: int) -> Vehicle:
    return _view(repository.get_one(session, vehicle_id))


def list_given_gains(session: Session, vehicle_id: int, *, limit: int, cursor: str | None) -> Page[GivenGains]:
    """The newest first."""
    repository.get_one(session, vehicle_id)
    before = None if cursor is None else decode_cursor("-id", cursor, float)[1]
    rows, total = repository.flights(session, vehicle_id, before_id=before, limit=limit)
    items = [
        GivenGains(
            flight_id=row.id,
            campaign_id=row.campaign_id,
            trial_id=row.trial_id,
            asked=row.gains,
            read_back=row.read_back,
            outcome=row.state,
            asked_at=row.claimed_at,
        )
        for row in rows[:limit]
    ]
    following = encode_cursor("-id", (0, rows[limit - 1].id)) if len(rows) > limit else None
    return Page(items=items, total=total, next_cursor=following)


def release_vehicle(session: Session, vehicle_id: int, statement: str) -> Vehicle:
    """Out of quarantine, on a person's word. Raises ConflictError when it is in none."""
    row = repository.get_one(session, vehicle_id)
    check_action(ACTIONS, "release", row.state, row.title)
    move_vehicle(row, VehicleState.READY)
    row.concern = f"Released: {statement}"
    session.flush()
    return _view(row)


def _view(row: VehicleRow) -> Vehicle:
    return Vehicle(
        id=row.id,
        kind=row.kind,
        title=row.title,
        is_real=row.is_real,
        can_fly=can_fly(row),
        state=row.state,
        concern=row.concern,
        safe_gains=row.safe_gains,
        actions=[action for action in allowed(ACTIONS, row.state) if action != "fly" or can_fly(row)],
    )
