"""Comparison of two logs of one vehicle: which parameters differ, and what the change of the gains does."""

from sqlalchemy.orm import Session

from app.autopilots.registry import AUTOPILOTS
from app.common.errors import InputError, Problem
from app.log_library import repository, stored_answers
from app.log_library.library_schemas import LogComparison
from app.log_library.parameter_changes import parameter_changes
from app.log_library.stored_logs import log_view


def compare(session: Session, log_id: int, before_id: int | None) -> LogComparison:
    """Compare a log with an earlier one, by default the one before it of the same vehicle.

    Raises NotFoundError; InputError without an earlier one.
    """
    log = repository.log_with_answer(session, log_id)
    earlier = repository.log_before(session, log) if before_id is None else before_id
    if earlier is None:
        raise InputError(
            "There is no earlier log to compare with.",
            hint="Keep another log of this vehicle, or choose a log.",
            problems=(Problem("before", "is missing"),),
        )
    before = repository.log_with_answer(session, earlier)
    if log.autopilot != before.autopilot:
        raise InputError(
            f"{log.file_name} is not compared with {before.file_name}: they are of different autopilots.",
            hint=f"Choose another log under {log.autopilot}.",
            problems=(Problem("before", f"was flown under {before.autopilot}"),),
        )
    autopilot = next(each for each in AUTOPILOTS.values() if each.title == log.autopilot)
    held = [stored_answers.unpack(each.answer).parameters for each in (before, log)]
    return LogComparison(
        log=log_view(log),
        before=log_view(before),
        verdict="not known yet",
        confidence=None,
        effect=None,
        sentence="",
        notes=[],
        parameters=parameter_changes(autopilot, *held),
    )
