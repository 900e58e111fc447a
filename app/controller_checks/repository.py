"""Queries on controller checks."""

from collections.abc import Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session, undefer

from app.common.errors import NotFoundError
from app.db.models import ControllerCheckRow


def get_one(session: Session, check_id: int) -> ControllerCheckRow:
    """The check with that id, with its result. Raises NotFoundError."""
    row = session.get(ControllerCheckRow, check_id, options=[undefer(ControllerCheckRow.result)])
    if row is None:
        raise NotFoundError("controller check", check_id)
    return row


def page(session: Session, *, before_id: int | None, limit: int) -> tuple[Sequence[ControllerCheckRow], int]:
    """The newest `limit` + 1 checks before that id, without their results, and the total count."""
    wanted = select(ControllerCheckRow)
    if before_id is not None:
        wanted = wanted.where(ControllerCheckRow.id < before_id)
    total = session.scalar(select(func.count()).select_from(ControllerCheckRow)) or 0
    return session.scalars(wanted.order_by(ControllerCheckRow.id.desc()).limit(limit + 1)).all(), total
