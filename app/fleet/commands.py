"""Acts: requests to a registered vehicle beside its flights. A person makes them; the worker carries them out.

    request_act → claim_act → finish_act
                     └ with the outcome, in the same transaction: record_disconnected, quarantine_vehicle,
                       record_released, record_checks; of a connect by finish_connect instead

Land and motors off bypass the database; `record_command` records them afterwards. At a worker's start: `recover`, then
`request_reconnections`. Later, `list_vehicles_to_reconnect` lists those that are not connected yet, until
`record_reconnected`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import timedelta
from typing import Final

from sqlalchemy.orm import Session

from app.accounts.permissions import Permission, RequestContext
from app.common.conflict_checks import check_action, check_transition
from app.common.errors import ConflictError
from app.common.states import ACT_TRANSITIONS, GIVES_GAINS, VEHICLE_ACTIONS, ActKind, ActState, VehicleState
from app.db.base import JsonObject, utc_now
from app.db.models import VehicleActRow, VehicleRow
from app.db.session import Database
from app.fleet import repository
from app.fleet.control import record_act, require_may, require_may_command, require_not_controlled_by_other
from app.fleet.schemas import Vehicle, VehicleAct
from app.fleet.service import (
    hold_gains,
    is_linked_or_wanted,
    require_idle,
    set_vehicle_state,
    settings_of,
    vehicle_view,
)
from app.vehicles.base import CheckItem, ConnectionOpened, Identity, LinkedVehicle

REQUEST_TIMEOUT: Final = timedelta(seconds=10)
"""Maximum age of a request when a worker claims it."""
AIRBORNE_FOR: Final = timedelta(hours=1)
"""A flight that began longer ago than this is not taken for one that may be in the air: most batteries are empty."""
BY_WORKER: Final = "the worker"

_WITHDRAWN: Final = {
    ActState.REQUESTED: "It was not started: no worker was running when it was requested.",
    ActState.RUNNING: "It was not finished: the worker stopped.",
}
_READ_ONLY_ACTS: Final = frozenset({ActKind.CHECK, ActKind.PARAMETERS})
"""Acts that change nothing on the vehicle, so that every operator may request them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ActTask:
    """One act, for the worker that carries it out."""

    act_id: int
    kind: ActKind
    vehicle: LinkedVehicle


def request_act(session: Session, vehicle_id: int, kind: ActKind, context: RequestContext) -> VehicleAct:
    """Request an act.

    Raises ConflictError in states in which it is not possible or while another operator is in control, BusyError while
    a flight or another act is under way, NotAllowedError when the client may not command the vehicle.
    """
    row = repository.get_one(session, vehicle_id)
    if not row.registered:
        raise ConflictError(
            f"{row.name} is shared by all campaigns and needs no link.", hint="Fly it from a campaign, without staging."
        )
    return VehicleAct.view_of(_requested(session, row, kind, context))


def require_may_stop_motors(database: Database, vehicle_id: int, context: RequestContext) -> None:
    """Raise NotAllowedError when the client may not command a real vehicle, NotFoundError when there is no such
    vehicle."""
    with database.read() as session:
        require_may(Permission.STOP, repository.get_one(session, vehicle_id), context)


def release_vehicle(session: Session, vehicle_id: int, statement: str, context: RequestContext) -> Vehicle:
    """Release a vehicle from quarantine on a person's statement.

    A registered vehicle is released once the worker has verified that it is disarmed and holds its safe gains. Raises
    as `request_act` does.
    """
    row = repository.get_one(session, vehicle_id)
    if row.registered:
        _requested(session, row, ActKind.RELEASE, context, reason=statement)
        return vehicle_view(row)
    check_action(VEHICLE_ACTIONS, "release", row.state, row.name)
    by = require_not_controlled_by_other(row, context)
    record_act(session, row, ActKind.RELEASE, by=by, reason=statement)
    record_released(session, row.id)
    return vehicle_view(row)


def _requested(
    session: Session, row: VehicleRow, kind: ActKind, context: RequestContext, *, reason: str = ""
) -> VehicleActRow:
    check_action(VEHICLE_ACTIONS, kind, row.state, row.name)
    if kind == ActKind.DISCONNECT:
        require_may(Permission.STOP, row, context)
        if not is_linked_or_wanted(row):
            raise ConflictError(f"{row.name} is neither connected nor reconnecting.", hint="Connect it.")
    else:
        require_may_command(row, context)
    by = "" if kind in _READ_ONLY_ACTS else require_not_controlled_by_other(row, context)
    require_idle(session, row)
    if kind in {ActKind.CONNECT, ActKind.DISCONNECT}:
        row.wanted_connected = kind == ActKind.CONNECT
    return _add(session, row, kind, by=by, reason=reason)


def _add(session: Session, row: VehicleRow, kind: ActKind, *, by: str, reason: str = "") -> VehicleActRow:
    asked = dict(row.safe_gains) if kind in GIVES_GAINS else None
    return record_act(session, row, kind, by=by, reason=reason, asked=asked, state=ActState.REQUESTED)


def claim_act(session: Session, worker: str) -> ActTask | None:
    """Claim the oldest requested act for this worker; None when there is none.

    A request older than REQUEST_TIMEOUT (10 s) is given up, because nothing may happen later than its operator expects.
    """
    while (act := repository.first_requested_act(session)) is not None:
        if utc_now() - act.requested_at <= REQUEST_TIMEOUT:
            _move(act, ActState.RUNNING)
            act.worker, act.claimed_at = worker, utc_now()
            return ActTask(act_id=act.id, kind=act.kind, vehicle=_linked(session, act.vehicle))
        _end(act, problem=f"It could not be started within {REQUEST_TIMEOUT.total_seconds():g} s. Request it again.")
    return None


def finish_act(
    session: Session,
    act_id: int,
    *,
    read_back: Mapping[str, float] | None = None,
    result: JsonObject | None = None,
    problem: str = "",
) -> None:
    """Record the outcome of an act; `problem` when it failed. Idempotent.

    A connect wrote no gains to a vehicle that is not pinned or was not read back. If it fails for a pinned vehicle, the
    worker keeps looking for the vehicle: it may be switched off, or another process may have its port.
    """
    act = repository.get_act(session, act_id)
    if act.state != ActState.RUNNING:
        return
    act.result = result
    if act.kind == ActKind.CONNECT and not _was_given(act.vehicle, read_back):
        act.asked = None
    if read_back is not None:
        act.read_back = dict(read_back)
        hold_gains(act.vehicle, read_back)
    _end(act, problem=problem, still_wanted=act.vehicle.identity is not None)


def finish_connect(session: Session, task: ActTask, opened: ConnectionOpened) -> None:
    """Record an open link as `record_connected`, and the outcome of its act.

    In this order: connecting wrote gains only to a vehicle that was pinned before. The act keeps the concern as its
    reason.
    """
    finish_act(session, task.act_id, read_back=opened.held or None)
    repository.get_act(session, task.act_id).reason = opened.concern
    record_connected(session, task.vehicle.vehicle_id, opened)


def recover(session: Session) -> None:
    """End all requested and running acts at a worker's start; they are not carried out later. No link is open then:
    set ready vehicles to disconnected; a quarantined vehicle stays quarantined."""
    for act in repository.acts_under_way(session):
        _end(act, problem=f"{_WITHDRAWN[act.state]} Request it again if it is still needed.")
    for row in repository.registered_in(session, VehicleState.READY):
        set_vehicle_state(row, VehicleState.DISCONNECTED)


def request_reconnections(session: Session) -> list[int]:
    """Request connects, at a worker's start, for the vehicles that are wanted connected. Returns the ids of the
    acts."""
    return [_add(session, row, ActKind.CONNECT, by=BY_WORKER).id for row in _wanted(session)]


def list_vehicles_to_reconnect(session: Session) -> list[LinkedVehicle]:
    """Vehicles that are wanted connected and have neither an act nor a flight under way."""
    rows = _wanted(session)
    return [_linked(session, row) for row in rows if repository.flight_under_way(session, row.id) is None]


def _wanted(session: Session) -> list[VehicleRow]:
    rows = repository.registered_in(session, VehicleState.DISCONNECTED, VehicleState.QUARANTINED)
    return [row for row in rows if row.wanted_connected and repository.act_under_way(session, row.id) is None]


def record_reconnected(session: Session, vehicle_id: int, opened: ConnectionOpened) -> bool:
    """Record that a vehicle was reconnected without a request.

    Returns False, and leaves the vehicle disconnected, if it is no longer wanted connected or was deleted.
    """
    row = session.get(VehicleRow, vehicle_id)
    if row is None or not row.wanted_connected:
        return False
    read_back = dict(opened.held) or None
    given = dict(row.safe_gains) if _was_given(row, read_back) else None
    record_connected(session, vehicle_id, opened)
    reason = opened.concern or "it is reachable again"
    act = record_act(session, row, ActKind.CONNECT, by=BY_WORKER, reason=reason, asked=given)
    act.read_back = read_back
    return True


def record_connected(session: Session, vehicle_id: int, opened: ConnectionOpened) -> None:
    """Record an open link. The vehicle is ready, or quarantined when there is a concern, old or new.

    Its identity is pinned at the first connection without a concern; version and hardware id are added when it first
    reports them. No gains are written to a vehicle that is not pinned, because no person has decided yet about the
    gains that it was found with. The last preflight check says nothing of the vehicle that answers now.
    """
    row = repository.get_one(session, vehicle_id)
    known = opened.concern or row.concern
    row.checks = row.checked_at = None
    if not opened.concern:
        pin_identity(session, vehicle_id, opened.identity)
    if opened.held:
        hold_gains(row, opened.held)
    _move_to(row, VehicleState.QUARANTINED if known else VehicleState.READY, known)


def pin_identity(session: Session, vehicle_id: int, identity: Identity) -> None:
    """Pin the identity: what is pinned stays; what was missing is added, because some autopilots report all of it only
    after a while."""
    row = repository.get_one(session, vehicle_id)
    pinned = _pinned(row)
    row.identity = asdict(identity if pinned is None else pinned.completed_by(identity))


def record_disconnected(session: Session, vehicle_id: int, *, concern: str = "") -> None:
    """Record a closed link. A concern is kept: the vehicle is quarantined when it is connected again."""
    row = repository.get_one(session, vehicle_id)
    _move_to(row, VehicleState.DISCONNECTED, concern or row.concern)


def quarantine_vehicle(session: Session, vehicle_id: int, concern: str) -> None:
    """Quarantine the vehicle; `concern` says what could not be verified."""
    row = repository.get_one(session, vehicle_id)
    _move_to(row, VehicleState.QUARANTINED, concern)


def record_released(session: Session, vehicle_id: int, *, identity: Identity | None = None) -> None:
    """End the quarantine. `identity`: the identity that answers now, which the person has accepted."""
    row = repository.get_one(session, vehicle_id)
    row.checks = row.checked_at = None
    if identity is not None:
        row.identity = asdict(identity)
    _move_to(row, VehicleState.READY, "")


def record_checks(session: Session, vehicle_id: int, checks: Iterable[CheckItem] | None) -> None:
    """Record the results of the preflight check; None once the vehicle has restarted, perhaps with other settings."""
    row = repository.get_one(session, vehicle_id)
    row.checks = None if checks is None else [asdict(check) for check in checks]
    row.checked_at = None if checks is None else utc_now()


def record_command(session: Session, vehicle_id: int, kind: ActKind, reason: str, *, problem: str = "") -> None:
    """Record a land or motors off command after it was sent; `problem` when it could not be sent."""
    row = repository.get_one(session, vehicle_id)
    act = record_act(session, row, kind, by="", reason=reason)
    if problem:
        act.state, act.problem = ActState.FAILED, problem


def _linked(session: Session, row: VehicleRow) -> LinkedVehicle:
    since = utc_now() - AIRBORNE_FOR
    return LinkedVehicle(
        vehicle_id=row.id,
        name=row.name,
        kind=row.kind,
        options=settings_of(row),
        safe_gains=dict(row.safe_gains),
        identity=_pinned(row),
        was_flying=repository.has_taken_off(session, row.id, since=max(since, row.held_at or since)),
    )


def _was_given(row: VehicleRow, read_back: Mapping[str, float] | None) -> bool:
    """Whether connecting wrote the safe gains; on a vehicle that is armed, absent or not pinned nothing is written."""
    return row.identity is not None and read_back is not None


def _pinned(row: VehicleRow) -> Identity | None:
    return None if row.identity is None else Identity(**row.identity)


def _move_to(row: VehicleRow, state: VehicleState, concern: str) -> None:
    row.concern = concern
    if row.state != state:
        set_vehicle_state(row, state)


def _move(act: VehicleActRow, to: ActState) -> None:
    act.state = check_transition(ACT_TRANSITIONS, act.state, to, f"Act {act.id}")


def _end(act: VehicleActRow, *, problem: str, still_wanted: bool = False) -> None:
    _move(act, ActState.FAILED if problem else ActState.DONE)
    act.problem, act.finished_at = problem, utc_now()
    if problem and act.kind == ActKind.CONNECT and act.by != BY_WORKER and not still_wanted:
        act.vehicle.wanted_connected = False
