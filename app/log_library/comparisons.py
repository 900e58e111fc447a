"""Comparison of two logs of one vehicle: which parameters differ, and what the change of the gains does."""

from sqlalchemy.orm import Session

from app.common.errors import InputError, Problem
from app.log_library import repository, stored_answers
from app.log_library.library_schemas import LogComparison, ParameterChange
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
    held = [stored_answers.unpack(each.answer).parameters for each in (before, log)]
    return LogComparison(
        log=log_view(log),
        before=log_view(before),
        verdict="not known yet",
        confidence=None,
        effect=None,
        sentence="",
        notes=[],
        parameters=[
            ParameterChange(name=name, group="other", before=held[0].get(name), after=held[1].get(name))
            for name in sorted(held[0].keys() | held[1].keys())
            if held[0].get(name) != held[1].get(name)
        ],
    )
