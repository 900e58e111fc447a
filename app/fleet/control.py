"""Control of a vehicle: one operator at a time, by a lease that the browser renews; a take-over is visible.

Only the operator's browser knows the lease's token; the row holds its digest.
"""

import hashlib
import hmac
import secrets
from datetime import timedelta
from typing import Final

from sqlalchemy import update
from sqlalchemy.orm import Session

from app.accounts.permissions import STAGED_BY_SCRIPT, Permission, RequestContext, is_allowed, require
from app.common.errors import ConflictError, NotAllowedError
from app.common.states import ActKind, ActState
from app.db.base import JsonObject, added, utc_now
from app.db.models import VehicleActRow, VehicleRow
from app.fleet import repository
from app.fleet.schemas import Control, Lease, LeaseRequest

LEASE: Final = timedelta(seconds=15)
"""A browser renews the lease every 5 s; without renewal it ends after this time."""


def control_of(row: VehicleRow) -> Control | None:
    """The operator now in control; None when there is none."""
    if row.operator is None or row.operator_until is None or row.operator_until <= utc_now():
        return None
    return Control(operator=row.operator, until=row.operator_until)


def take_control(session: Session, vehicle_id: int, asked: LeaseRequest, context: RequestContext) -> Lease:
    """Grant a new lease, or renew it by its token; with `take_over` also one of another operator, which an act records.

    Raises ConflictError that names the operator in control or says that the token's lease has ended; NotAllowedError
    when the client may not command the vehicle.
    """
    row = repository.get_one(session, vehicle_id)
    require_may_command(row, context)
    if asked.token is not None and holds(row, asked.token):
        return _granted(session, row, asked.operator, asked.token)
    held = control_of(row)
    if held is not None and not asked.take_over:
        raise ConflictError(
            f"{held.operator} is in control of {row.name}.",
            hint="Agree with them, then take over; every operator sees a takeover.",
        )
    if asked.token is not None and not asked.take_over:
        raise ConflictError(f"Your control of {row.name} has ended.", hint="Take control again.")
    if held is not None:
        record_act(session, row, ActKind.CONTROL, by=asked.operator, reason=f"took over from {held.operator}")
    return _granted(session, row, asked.operator, secrets.token_urlsafe(24))


def give_up_control(session: Session, vehicle_id: int, token: str | None) -> None:
    """Give up control; does nothing when there is no lease. Raises ConflictError when another operator is in
    control."""
    row = repository.get_one(session, vehicle_id)
    if (held := control_of(row)) is None:
        return
    if token is None or not holds(row, token):
        raise ConflictError(
            f"{held.operator} is in control of {row.name}, not you.",
            hint="Only the operator in control can release it.",
        )
    row.operator = row.operator_token_hash = row.operator_until = None


def holds(row: VehicleRow, token: str) -> bool:
    """Whether the token is that of the vehicle's last lease, which may have ended without another one following."""
    return row.operator_token_hash is not None and hmac.compare_digest(row.operator_token_hash, _digest(token))


def require_not_controlled_by_other(row: VehicleRow, context: RequestContext) -> str:
    """Return the operator of the request, empty if there is no lease. Raises ConflictError if another operator is in
    control."""
    if (held := control_of(row)) is None:
        return ""
    if context.token is None or not holds(row, context.token):
        raise ConflictError(
            f"{held.operator} is in control of {row.name}.",
            hint="Ask them to do it, or take over. Abort, land, motors off and unstage do not require control.",
        )
    return held.operator


def is_in_control(row: VehicleRow, context: RequestContext) -> bool:
    """Whether the request may command the vehicle as far as control is concerned: its operator's token is needed for a
    real vehicle with a link, and for any that another operator controls."""
    if control_of(row) is None:
        return not (row.is_real and row.registered)
    return context.token is not None and holds(row, context.token)


def require_control(row: VehicleRow, context: RequestContext) -> str:
    """Return the operator in control, who must send the request from Gainline's own page in an unlocked browser on this
    computer; a real vehicle takes off on no other request. Raises NotAllowedError or ConflictError otherwise."""
    require(Permission.TAKE_OFF, context.caller, row.name)
    if not context.from_our_page:
        raise NotAllowedError(
            f"{row.name} is a real vehicle: only its operator can start the takeoff, in the browser.",
            hint="Hold the button on the flight's fly screen.",
            script_hint=STAGED_BY_SCRIPT,
        )
    operator = require_not_controlled_by_other(row, context)
    if not operator:
        raise ConflictError(f"No operator is in control of {row.name}.", hint="Take control on the fly screen first.")
    return operator


def may_command(row: VehicleRow, context: RequestContext) -> bool:
    """Whether the client may command the vehicle, as far as its key and its place are concerned. Simulations without a
    link are open to all."""
    return not row.registered or is_allowed(_to_command(row), context.caller)


def require_may_command(row: VehicleRow, context: RequestContext) -> None:
    """Raise NotAllowedError unless `may_command`."""
    if row.registered:
        require(_to_command(row), context.caller, row.name)


def _to_command(row: VehicleRow) -> Permission:
    return Permission.REAL if row.is_real else Permission.LINK


def require_may(act: Permission, row: VehicleRow, context: RequestContext) -> None:
    """Raise NotAllowedError when the client lacks the permission for a real vehicle with a link; others are open to
    all."""
    if row.registered and row.is_real:
        require(act, context.caller, row.name)


def record_act(
    session: Session,
    row: VehicleRow,
    kind: ActKind,
    *,
    by: str,
    reason: str,
    asked: dict[str, float] | None = None,
    result: JsonObject | None = None,
    state: ActState = ActState.DONE,
) -> VehicleActRow:
    """Record an act, by default one that is complete at once because it needs no answer from the vehicle, or has that
    of its flight."""
    now = utc_now()
    return added(
        session,
        VehicleActRow(
            vehicle_id=row.id,
            kind=kind,
            state=state,
            by=by,
            reason=reason,
            asked=asked,
            result=result,
            requested_at=now,
            finished_at=now if state == ActState.DONE else None,
        ),
    )


def _granted(session: Session, row: VehicleRow, operator: str, token: str) -> Lease:
    until = utc_now() + LEASE
    if row.operator == operator and row.operator_token_hash == _digest(token) and control_of(row) is not None:
        # Renewed every few seconds, so no event is published: a client that shows the lease loads it again when it
        # would end.
        session.execute(update(VehicleRow).where(VehicleRow.id == row.id).values(operator_until=until))
    else:
        row.operator, row.operator_token_hash, row.operator_until = operator, _digest(token), until
    return Lease(operator=operator, token=token, until=until)


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
