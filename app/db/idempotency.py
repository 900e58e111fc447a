"""Idempotent requests: the first answer is stored in the transaction that carried the request out."""

from collections.abc import Callable
from datetime import timedelta
from typing import Final, TypeVar

from pydantic import BaseModel
from sqlalchemy import delete
from sqlalchemy.orm import Session

from app.common.errors import KeyReusedError, Problem
from app.db.models import IdempotencyRow
from app.db.types import utc_now

KEPT: Final = timedelta(days=7)
M = TypeVar("M", bound=BaseModel)


def carry_out_once(session: Session, key: str, fingerprint: str, answer: type[M], work: Callable[[Session], M]) -> M:
    """Call `work`, or return its stored answer for this key.

    The session must hold the write lock, so that two requests with one key run one after another. Raises KeyReusedError
    when the key came with another request.
    """
    if (known := session.get(IdempotencyRow, key)) is not None:
        if known.fingerprint != fingerprint:
            raise KeyReusedError(
                f"The idempotency key {key!r} has already been used for another request.",
                hint="Use a new key for every operation, and the same key only to repeat an identical request.",
                problems=(Problem("Idempotency-Key", "belongs to another request"),),
            )
        return answer.model_validate_json(known.answer)
    session.execute(delete(IdempotencyRow).where(IdempotencyRow.created_at < utc_now() - KEPT))
    result = work(session)
    session.add(IdempotencyRow(key=key, fingerprint=fingerprint, answer=result.model_dump_json()))
    return result
