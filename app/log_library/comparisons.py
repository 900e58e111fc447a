"""Comparison of two logs of one vehicle: which parameters differ, and what the change of the gains does."""

from collections.abc import Sequence
from functools import lru_cache

from sqlalchemy.orm import Session

from app.autopilots.registry import AUTOPILOTS
from app.common.errors import InputError, Problem
from app.core.statistics.gain_change import FlownLog, GainChange, compare_logs, compare_takeoffs
from app.db.models import AnalysedLogRow
from app.log_library import repository, stored_answers
from app.log_library.library_schemas import ErrorChange, LogComparison, StoredAnswer
from app.log_library.parameter_changes import parameter_changes
from app.log_library.stored_logs import log_view
from app.log_library.texts import notes_of, sentence_of


def compare(session: Session, log_id: int, before_id: int | None) -> LogComparison:
    """Compare a log with another one of the same vehicle, by default the one before it.

    Raises NotFoundError; InputError without another one, or for one of another vehicle or autopilot.
    """
    log = repository.log_with_answer(session, log_id)
    other = repository.log_before(session, log) if before_id is None else before_id
    if other is None:
        raise _refused("There is no earlier log to compare with.", "Keep another log of this vehicle.", "is missing")
    before = repository.log_with_answer(session, other)
    one, another = ((each.vehicle_id, each.autopilot) for each in (log, before))
    if other == log_id or log.vehicle_id is None or one != another:
        happened = f"{log.file_name} is not compared with {before.file_name}."
        raise _refused(happened, "Choose another log of its vehicle.", "is no other log of its vehicle and autopilot")
    stored = [stored_answers.unpack(each.answer) for each in (before, log)]
    found = _gain_change((before, log), stored)
    gains = found.comparison
    return LogComparison(
        log=log_view(log),
        before=log_view(before),
        verdict=found.verdict,
        confidence=None if gains is None else gains.confidence,
        basis=found.basis,
        change=ErrorChange.view_of(found, standard_error_m=None if gains is None else gains.standard_error),
        is_contradicted=found.is_contradicted,
        sentence=sentence_of(found),
        notes=notes_of(found),
        parameters=parameter_changes(AUTOPILOTS[log.autopilot], *(each.parameters for each in stored)),
    )


def _refused(happened: str, hint: str, reason: str) -> InputError:
    return InputError(happened, hint=hint, problems=(Problem("before", reason),))


def _gain_change(rows: Sequence[AnalysedLogRow], stored: Sequence[StoredAnswer]) -> GainChange:
    takeoffs = [each.takeoffs for each in stored]
    if all(takeoffs):
        return compare_takeoffs(*takeoffs)
    return _compare_flights(*((log_view(each).numbers.deviation_m, each.flight) for each in rows))


@lru_cache(maxsize=64)  # what visitors look at again takes no time
def _compare_flights(*logs: tuple[float | None, bytes | None]) -> GainChange:
    """Compare two logs by their errors and packed flights."""
    return compare_logs(*(_flown(*each) for each in logs))


def _flown(error_m: float | None, packed: bytes | None) -> FlownLog:
    from app.log_library.flights import unpack_flight  # noqa: PLC0415 - imports every reader

    if packed is None:
        return FlownLog(error_m=error_m)
    unpacked = unpack_flight(packed)
    return FlownLog(error_m=error_m, flight=unpacked.flight, copters=unpacked.copters)
