"""Operations on controller checks: check a recording, read the result, delete it."""

from datetime import datetime
from typing import Annotated, Final, Literal

from pydantic import Field, TypeAdapter
from sqlalchemy import select
from sqlalchemy.orm import Session, undefer

from app.autopilots.loop_check import FigureName, LoopCheck, Result, SignalResult
from app.autopilots.registry import AUTOPILOTS
from app.common.errors import NotFoundError, StorageError
from app.common.schemas import Gains, Page, Schema, uploaded_name
from app.db.base import added
from app.db.models import ControllerCheckRow
from app.db.pages import Order, page_of
from app.figures.base import Card, card_of
from app.figures.panels import PanelsFigure, replica_plot
from app.figures.theme import ThemeName
from app.processes.calls import FILE, run_limited
from app.reproductions.controller import RECORDED_TAKEOFF


def get_one(session: Session, check_id: int) -> ControllerCheckRow:
    """The check with that id, with its result. Raises NotFoundError."""
    row = session.get(ControllerCheckRow, check_id, options=[undefer(ControllerCheckRow.result)])
    if row is None:
        raise NotFoundError("controller check", check_id)
    return row


class ControllerCheckSummary(Schema):
    """A recording that was compared with the replica of its autopilot's loop: `log`, of a flight, or `trace`, with
    every step."""

    id: int
    file_name: str
    kind: Literal["log", "trace"]
    passed: bool
    checked_at: datetime


class CheckFigure(Schema):
    """An available figure of the check."""

    name: FigureName
    title: str


class ControllerCheck(ControllerCheckSummary):
    """The result as a sentence, the gains and notes behind it, and one line for each signal."""

    autopilot: Annotated[str, Field(description="the autopilot whose replica was used")]
    sentence: str
    rows: Annotated[int, Field(description="number of samples or steps compared")]
    gains: Annotated[Gains | None, Field(description="null if they change within the recording")]
    gains_from: str
    better_gains: Annotated[Gains | None, Field(description="other gains that reproduce more of the commands")]
    notes: list[str]
    signals: list[SignalResult]
    figures: list[CheckFigure]


_UNNAMED: Final = "recording"
_RESULT: Final = TypeAdapter(Result)


def check_upload(content: bytes, *, name: str, companion: bytes | None, gains: str | None) -> Result:
    """Compare an uploaded recording with the replica, in a process with limits; stores nothing.

    Raises InputError that names what is wrong with it.
    """
    from app.autopilots.loop_checks import examine_content  # noqa: PLC0415 - imports every replica

    return run_limited(
        FILE, examine_content, content, name=uploaded_name(name, unnamed=_UNNAMED), companion=companion, gains=gains
    )


def examine_example() -> Result:
    """Check the takeoff that comes with the program, recorded from the autopilot's own code."""
    from app.autopilots.loop_checks import examine_file  # noqa: PLC0415 - imports every replica

    return examine_file(RECORDED_TAKEOFF)


def store_example(session: Session, result: Result) -> ControllerCheck:
    return store_check(session, RECORDED_TAKEOFF.name, result)


def store_check(session: Session, name: str, result: Result) -> ControllerCheck:
    """Store the result of a check; the recording itself is not kept."""
    row = ControllerCheckRow(
        file_name=uploaded_name(name, unnamed=_UNNAMED),
        kind=result.kind,
        passed=result.passed,
        result=result.as_json(),
    )
    return _view(added(session, row), result)


def list_checks(session: Session, *, limit: int, cursor: str | None) -> Page[ControllerCheckSummary]:
    """Page of checks, newest first."""
    return page_of(
        session,
        select(ControllerCheckRow),
        Order("-id", ControllerCheckRow.id.expression, descending=True),
        cursor=cursor,
        limit=limit,
        view=lambda rows: [ControllerCheckSummary.view_of(row) for row in rows],
    )


def get_check(session: Session, check_id: int) -> ControllerCheck:
    """The check with that id. Raises NotFoundError."""
    row = get_one(session, check_id)
    return _view(row, _result(row))


def figure(session: Session, check_id: int, name: FigureName, theme: ThemeName) -> Card:
    """Figure of one group of signals, recording and replica overlaid. Raises NotFoundError."""
    result = _result(get_one(session, check_id))
    check = _check(result)
    if name not in check.figures:
        raise NotFoundError("figure", name, hint=f"Available: {', '.join(check.figures)}.")
    title, signals = check.figures[name]
    summary = "; ".join(
        f"{signal.name} {signal.verdict}, largest difference {signal.largest_difference:.4g} {signal.difference_unit}"
        for signal in result.signals
        if signal.name in signals
    )
    drawn = [result.curves[signal] for signal in signals if signal in result.curves]
    if not drawn:
        missing = "The log contains no command that could be simulated again."
        return Card(name="controller", title=title, state="waiting", reason=missing)
    described = f"Recorded and replica overlaid: {summary}. {check.note}"
    return card_of(PanelsFigure(replica_plot(drawn, title, described), theme))


def delete_check(session: Session, check_id: int) -> None:
    """Delete a check. Raises NotFoundError."""
    session.delete(get_one(session, check_id))


def _result(row: ControllerCheckRow) -> Result:
    try:
        return _RESULT.validate_python(row.result)
    except ValueError as error:
        raise StorageError(
            f"Controller check {row.id} was made by another version of Gainline.", hint="Run the check again."
        ) from error


def _check(result: Result) -> LoopCheck:
    from app.autopilots.loop_checks import CHECKS  # noqa: PLC0415 - imports every replica

    return CHECKS[AUTOPILOTS[result.autopilot]]


def _view(row: ControllerCheckRow, result: Result) -> ControllerCheck:
    return ControllerCheck.view_of(
        result,
        id=row.id,
        file_name=row.file_name,
        checked_at=row.checked_at,
        autopilot=AUTOPILOTS[result.autopilot].title,
        figures=[CheckFigure(name=name, title=title) for name, (title, _) in _check(result).figures.items()],
    )
