"""Who is in control of a vehicle: one operator at a time, by a lease that the browser renews; a take-over is visible.

The token that shows it is known to its browser alone; the row holds a digest.
"""

import hashlib
import hmac
import secrets
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from sqlalchemy import update
from sqlalchemy.orm import Session

from app.access import COMMAND_LINE, Caller, Permission, require
from app.db.models import VehicleActRow, VehicleRow
from app.db.types import utc_now
from app.errors import ConflictError, NotAllowedError
from app.fleet import repository
from app.fleet.schemas import Control, Lease, LeaseRequest
from app.fleet.states import ActKind, ActState

LEASE: Final = timedelta(seconds=15)
"""A browser renews it every 5 s; one that is gone has lost it after this time."""


@dataclass(frozen=True, slots=True)
class RequestContext:
    """Where a request comes from: the lease's token that it carries, who sent it and from where, whether a page of ours
    did, and the hosts that the administrator says simulate vehicles."""

    token: str | None = None
    caller: Caller = COMMAND_LINE
    from_our_page: bool = False
    simulation_hosts: frozenset[str] = frozenset()


LOCAL_CLI: Final = RequestContext()
"""Somebody at this computer's command line, who is in control of nothing."""


def control_of(row: VehicleRow) -> Control | None:
    """Who is in control now; None when nobody is."""
    if row.operator is None or row.operator_until is None or row.operator_until <= utc_now():
        return None
    return Control(operator=row.operator, until=row.operator_until)


def take_control(session: Session, vehicle_id: int, asked: LeaseRequest, context: RequestContext) -> Lease:
    """A new lease, or the same one renewed by its token; with `take_over` also somebody else's, which an act records.

    Raises ConflictError naming who is in control, or saying that the token's lease is no longer there; NotAllowedError
    for who may not command the vehicle.
    """
    row = repository.get_one(session, vehicle_id)
    require_may_command(row, context)
    if asked.token is not None and holds(row, asked.token):
        return _granted(session, row, asked.operator, asked.token)
    held = control_of(row)
    if held is not None and not asked.take_over:
        raise ConflictError(
            f"{held.operator} is in control of {row.name}.",
            hint="Ask them to hand it over, or take over: everybody sees that.",
        )
    if asked.token is not None and not asked.take_over:
        raise ConflictError(f"Your control of {row.name} has ended.", hint="Take control again if you still want it.")
    if held is not None:
        record_act(session, row, ActKind.CONTROL, by=asked.operator, reason=f"took over from {held.operator}")
    return _granted(session, row, asked.operator, secrets.token_urlsafe(24))


def give_up_control(session: Session, vehicle_id: int, token: str | None) -> None:
    """Harmless when nobody is in control. Raises ConflictError when somebody else is."""
    row = repository.get_one(session, vehicle_id)
    if (held := control_of(row)) is None:
        return
    if token is None or not holds(row, token):
        raise ConflictError(
            f"{held.operator} is in control of {row.name}, not you.", hint="Only who has control can give it up."
        )
    row.operator = row.operator_token_hash = row.operator_until = None


def holds(row: VehicleRow, token: str) -> bool:
    """Whether the token is that of the vehicle's last lease, which may be over: nobody else has taken it since."""
    return row.operator_token_hash is not None and hmac.compare_digest(row.operator_token_hash, _digest(token))


def require_not_controlled_by_other(row: VehicleRow, context: RequestContext) -> str:
    """The operator who asks, empty when nobody is in control. Raises ConflictError when somebody else is."""
    if (held := control_of(row)) is None:
        return ""
    if context.token is None or not holds(row, context.token):
        raise ConflictError(
            f"{held.operator} is in control of {row.name}.",
            hint="Ask them to do it or to hand over control; abort, land and motors off are open to everybody.",
        )
    return held.operator


def require_control(row: VehicleRow, context: RequestContext) -> str:
    """The operator in control, who asks from a page of ours in an unlocked browser on this computer: the only one who
    may have a real vehicle take off. Raises NotAllowedError or ConflictError otherwise."""
    require(Permission.TAKE_OFF, context.caller, row.name)
    if not context.from_our_page:
        raise NotAllowedError(
            f"{row.name} is a real vehicle: it takes off only on its operator's own act in the browser.",
            hint="A script can propose gains and stage the flight; the operator then holds the button on the fly page.",
        )
    operator = require_not_controlled_by_other(row, context)
    if not operator:
        raise ConflictError(f"Nobody is in control of {row.name}.", hint="Take control on the fly page first.")
    return operator


def require_may_command(row: VehicleRow, context: RequestContext) -> None:
    """Raises NotAllowedError for who may not command a vehicle that has a link; simulations without one are for all."""
    if row.registered:
        require(Permission.REAL if row.is_real else Permission.LINK, context.caller, row.name)


def require_may(act: Permission, row: VehicleRow, context: RequestContext) -> None:
    """Raises NotAllowedError for who may not do this with a real vehicle that has a link; any other is for all."""
    if row.registered and row.is_real:
        require(act, context.caller, row.name)


def record_act(
    session: Session, row: VehicleRow, kind: ActKind, *, by: str, reason: str, asked: dict[str, float] | None = None
) -> VehicleActRow:
    """Something that was decided, and took no vehicle to answer it."""
    now = utc_now()
    act = VehicleActRow(
        vehicle_id=row.id,
        kind=kind,
        state=ActState.DONE,
        by=by,
        reason=reason,
        asked=asked,
        requested_at=now,
        finished_at=now,
    )
    session.add(act)
    session.flush()
    return act


def _granted(session: Session, row: VehicleRow, operator: str, token: str) -> Lease:
    until = utc_now() + LEASE
    if row.operator == operator and row.operator_token_hash == _digest(token) and control_of(row) is not None:
        # Renewed every few seconds: said to nobody, for whoever shows it asks again when it would be over.
        session.execute(update(VehicleRow).where(VehicleRow.id == row.id).values(operator_until=until))
    else:
        row.operator, row.operator_token_hash, row.operator_until = operator, _digest(token), until
    return Lease(operator=operator, token=token, until=until)


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
