"""Operations on controller checks: check a recording, read the result, delete it."""

from pathlib import PurePath
from typing import Final

from pydantic import TypeAdapter
from sqlalchemy.orm import Session

from app.common.errors import NotFoundError, StorageError
from app.common.schemas import Page, decode_cursor, encode_cursor, without_control_characters
from app.controller_checks import repository, schemas
from app.controller_checks.check import check_trace, parse_gains
from app.controller_checks.results import FIGURES, Result, examine_content, result_of
from app.db.models import ControllerCheckRow
from app.figures.base import Card, card_of
from app.figures.panels import ControllerFigure
from app.figures.theme import ThemeName
from app.logs.loop_trace import read_loop_trace
from app.processes.sandbox import FILE, run_limited
from app.reproductions.controller import RECORDED_TAKEOFF

_NAME_LENGTH: Final = 120
_UNNAMED: Final = "recording"
_RESULT: Final = TypeAdapter(Result)


def check_upload(content: bytes, *, name: str, companion: bytes | None, gains: str | None) -> Result:
    """Compare an uploaded recording with the replica, in a process with limits; stores nothing.

    Raises InputError that names what is wrong with it.
    """
    given = None if gains is None else parse_gains(gains)
    return run_limited(FILE, examine_content, content, name=named(name), companion=companion, given=given)


def examine_example() -> Result:
    """Check the takeoff that comes with the program, recorded from the autopilot's own code."""
    return result_of(check_trace(read_loop_trace(RECORDED_TAKEOFF)))


def store_example(session: Session, result: Result) -> schemas.ControllerCheck:
    return store_check(session, RECORDED_TAKEOFF.name, result)


def store_check(session: Session, name: str, result: Result) -> schemas.ControllerCheck:
    """Store the result of a check; the recording itself is not kept."""
    row = ControllerCheckRow(file_name=named(name), kind=result.kind, passed=result.passed, result=result.as_json())
    session.add(row)
    session.flush()
    return _view(row, result)


def list_checks(session: Session, *, limit: int, cursor: str | None) -> Page[schemas.ControllerCheckSummary]:
    """Page of checks, newest first."""
    before = None if cursor is None else decode_cursor("-id", cursor, float)[1]
    rows, total = repository.page(session, before_id=before, limit=limit)
    following = encode_cursor("-id", (0, rows[limit - 1].id)) if len(rows) > limit else None
    found = [schemas.ControllerCheckSummary.model_validate(row, from_attributes=True) for row in rows[:limit]]
    return Page(items=found, total=total, next_cursor=following)


def get_check(session: Session, check_id: int) -> schemas.ControllerCheck:
    """The check with that id. Raises NotFoundError."""
    row = repository.get_one(session, check_id)
    return _view(row, _result(row))


def figure(session: Session, check_id: int, name: str, theme: ThemeName) -> Card:
    """Figure of one group of signals, recording and replica overlaid. Raises NotFoundError."""
    result = _result(repository.get_one(session, check_id))
    if name not in FIGURES:
        raise NotFoundError("figure", name, hint=f"There are: {', '.join(FIGURES)}.")
    title, signals = FIGURES[name]
    said = "; ".join(
        f"{signal.name} {signal.verdict}, largest difference {signal.largest_difference:.4g} {signal.difference_unit}"
        for signal in result.signals
        if signal.name in signals
    )
    drawn = [result.curves[signal] for signal in signals if signal in result.curves]
    return card_of(ControllerFigure(drawn, title, f"Recorded and replica overlaid: {said}. z points down.", theme))


def delete_check(session: Session, check_id: int) -> None:
    """Delete a check. Raises NotFoundError."""
    session.delete(repository.get_one(session, check_id))


def named(name: str) -> str:
    """Name of an uploaded file: shortened, without folders and control characters."""
    return without_control_characters(PurePath(name.replace("\\", "/")).name).strip()[:_NAME_LENGTH] or _UNNAMED


def _result(row: ControllerCheckRow) -> Result:
    try:
        return _RESULT.validate_python(row.result)
    except ValueError as error:
        raise StorageError(
            f"Controller check {row.id} was made by another version of the program.", hint="Check the recording again."
        ) from error


def _view(row: ControllerCheckRow, result: Result) -> schemas.ControllerCheck:
    return schemas.ControllerCheck.model_validate(
        {
            "id": row.id,
            "file_name": row.file_name,
            "checked_at": row.checked_at,
            **{name: getattr(result, name) for name in _FROM_RESULT},
            "figures": [{"name": name, "title": title} for name, (title, _) in FIGURES.items()],
        },
        from_attributes=True,
    )


_FROM_RESULT: Final = (
    "kind", "passed", "sentence", "rows", "gains", "gains_from", "better_gains", "notes", "signals",
)  # fmt: skip
