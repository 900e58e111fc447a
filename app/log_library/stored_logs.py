"""Operations on analysed logs: each is stored when it is analysed, kept as a flight of a vehicle, or deleted."""

import hashlib
from contextlib import suppress
from dataclasses import asdict
from datetime import timedelta
from pathlib import PurePath
from typing import Final

from sqlalchemy.orm import Session

from app import __version__
from app.autopilots.registry import AUTOPILOTS
from app.common.errors import ConflictError, InputError, NotFoundError, Problem, StorageError, TooLargeError
from app.common.schemas import Page
from app.db.base import added, utc_now
from app.db.models import AnalysedLogRow, LogFileRow, LoggedVehicleRow
from app.db.pages import Part, page_of
from app.fleet import service as fleet
from app.log_library import repository, stored_answers
from app.log_library.library_schemas import (
    AnalysedContent,
    AnalysedLog,
    LogAnalysis,
    LogExport,
    LoggedVehicle,
    LoggedVehicleBrief,
    LogNumbers,
    LogPlace,
    StoredAnswer,
)

UNKEPT_FOR: Final = timedelta(days=7)


def digest_of(content: bytes, companion: bytes | None, *, gains: str = "", vehicle: int | None = None) -> str:
    """What the same log has when it is analysed again in the same way."""
    parts = (content, companion or b"", gains.encode(), b"" if vehicle is None else str(vehicle).encode())
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def answered(session: Session, digest: str) -> LogAnalysis | None:
    """What this version has answered to the log before; None if nothing, and if that cannot be read or is due to be
    deleted."""
    row = repository.of_digest_or_none(session, digest)
    if row is None or row.program != __version__ or (row.vehicle is None and row.analysed_at < utc_now() - UNKEPT_FOR):
        return None
    with suppress(StorageError):
        return get_analysis(session, row.id)
    return None


def store(session: Session, found: AnalysedContent, digest: str, file_digest: str) -> int:
    """Store an answer, in the place of an older one to the same log; returns its id. Deletes those that nobody kept."""
    now = utc_now()
    repository.delete_analysed_before(session, now - UNKEPT_FOR)
    row = repository.of_digest_or_none(session, digest) or AnalysedLogRow(
        digest=digest, file_digest=file_digest, ordered_at=now
    )
    row.file_name, row.autopilot = found.answer.file_name, found.autopilot
    row.grade, row.program = found.answer.tuning.grade, __version__
    row.hardware_id, row.vehicle_name = found.hardware_id, found.vehicle_name
    row.flown_at, row.analysed_at, row.ordered_at = found.flown_at, now, found.flown_at or row.ordered_at
    row.numbers = found.numbers.model_dump(mode="json")
    row.fit = None if found.fit is None else asdict(found.fit)
    row.answer, row.flight = stored_answers.pack(found), found.flight
    return added(session, row).id


def get_analysis(session: Session, log_id: int) -> LogAnalysis:
    """A stored answer with its figures. Raises NotFoundError, StorageError."""
    row = repository.log_with_answer(session, log_id)
    stored = stored_answers.unpack(row.answer)
    return LogAnalysis(**dict(stored.answer), figures=stored_answers.cards(stored), log=_place(session, row, stored))


def export(session: Session, log_id: int) -> LogExport:
    """A stored answer with all parameters, for other programs. Raises NotFoundError, StorageError."""
    row = repository.log_with_answer(session, log_id)
    stored, vehicle = stored_answers.unpack(row.answer), row.vehicle
    return LogExport(
        **dict(stored.answer),
        program=row.program,
        flown_at=row.flown_at,
        analysed_at=row.analysed_at,
        vehicle_name=None if vehicle is None else vehicle.name,
        hardware_id=row.hardware_id,
        parameters=stored.parameters,
    )


def list_logs(session: Session, part: Part, *, vehicle_id: int | None, kept: bool) -> Page[AnalysedLog]:
    """Logs, newest first. Raises InputError for a cursor of another list."""
    return page_of(
        session,
        repository.logs(vehicle_id, kept=kept),
        repository.NEWEST_FIRST,
        part,
        lambda rows: [log_view(row) for row in rows],
    )


def list_vehicles(session: Session) -> list[LoggedVehicle]:
    """The vehicles with kept logs, the one that flew last first."""
    return [vehicle_view(*each) for each in repository.vehicles(session)]


def vehicle_id_of(session: Session, name: str) -> int:
    """Id of the vehicle of that name, ignoring case. Raises NotFoundError."""
    if (found := repository.vehicle_of_name_or_none(session, name)) is None:
        raise NotFoundError("vehicle of logs", name, hint="`gainline logs list` shows the vehicles with kept logs.")
    return found.id


def vehicle_view(vehicle: LoggedVehicleRow, logs: int, newest: AnalysedLogRow) -> LoggedVehicle:
    return LoggedVehicle.view_of(vehicle, logs=logs, newest=log_view(newest))


def keep(session: Session, log_id: int, name: str) -> LogPlace:
    """Keep a log as a flight of the vehicle with its hardware id, else of that name, which is created if need be.

    Raises NotFoundError; ConflictError if the name is that of another vehicle than the hardware id.
    """
    row = repository.log_with_answer(session, log_id)
    known, named = _known(session, row), repository.vehicle_of_name_or_none(session, name)
    if named is not None and row.hardware_id and named.hardware_id not in (None, row.hardware_id):
        raise ConflictError(
            f"The log was not kept: {named.name} has another hardware id.", hint="Choose another name for this vehicle."
        )
    if known is not None and named is not known:
        raise ConflictError(
            f"The log was not kept: its hardware id is that of {known.name}.", hint=f"Keep it as a log of {known.name}."
        )
    before = row.vehicle
    row.vehicle = known or named or added(session, LoggedVehicleRow(name=name, hardware_id=None))
    row.vehicle.hardware_id = row.hardware_id or row.vehicle.hardware_id
    session.flush()
    _forget_without_logs(session, before)
    return _place(session, row, stored_answers.unpack(row.answer))


def rename_vehicle(session: Session, vehicle_id: int, name: str) -> LoggedVehicleBrief:
    """Rename a vehicle. Raises NotFoundError; ConflictError if another one has the name."""
    vehicle, named = repository.get_vehicle(session, vehicle_id), repository.vehicle_of_name_or_none(session, name)
    if named is not None and named is not vehicle:
        raise ConflictError(f"There is another vehicle called {named.name}.", hint="Choose another name.")
    vehicle.name = name
    return LoggedVehicleBrief.view_of(vehicle)


def delete_log(session: Session, log_id: int) -> None:
    """Delete a log with its file, and its vehicle if that was the last one. Raises NotFoundError."""
    row = repository.get_log(session, log_id)
    vehicle = row.vehicle
    session.delete(row)
    session.flush()
    _forget_without_logs(session, vehicle)


def store_file(session: Session, log_id: int, content: bytes, companion: bytes | None, *, quota_bytes: int) -> LogPlace:
    """Store the file of a kept log, with its companion.

    Raises NotFoundError; ConflictError if the log is not kept; InputError if it is another file; TooLargeError if all
    files would take more than the quota.
    """
    row = repository.log_with_answer(session, log_id)
    if row.vehicle is None:
        raise ConflictError("The file was not stored: its log is not kept.", hint="Keep the log of a vehicle first.")
    stored = stored_answers.unpack(row.answer)
    if row.file_digest != digest_of(content, companion):
        problem = Problem("file", "is not the file that was analysed")
        raise InputError("The file was not stored.", hint=f"Choose {row.file_name}.", problems=(problem,))
    size = len(content) + len(companion or b"")
    if repository.stored_bytes(session) - row.file_bytes + size > quota_bytes:
        quota = f"{quota_bytes / 2**20:.4g} MiB"
        raise TooLargeError(
            f"The file was not stored: with it, stored logs would take more than {quota}. The answer is kept.",
            hint="Delete logs whose files are not needed, or raise GAINLINE_LOG_FILE_BYTES.",
            problems=(Problem("file", f"exceeds the quota of {quota}"),),
        )
    session.merge(LogFileRow(log_id=row.id, content=content, companion=companion))
    row.file_bytes = size
    session.flush()
    return _place(session, row, stored)


def file_content(session: Session, log_id: int, *, companion: bool) -> tuple[str, bytes]:
    """Name and content of a stored file, or of the .log file beside it. Raises NotFoundError."""
    name, stored = repository.get_log(session, log_id).file_name, repository.get_file(session, log_id)
    if not companion:
        return name, stored.content
    if stored.companion is None:
        raise NotFoundError("companion of log", log_id)
    return str(PurePath(name).with_suffix(".log")), stored.companion


def stored_answer(session: Session, log_id: int) -> StoredAnswer:
    """An answer as it is stored. Raises NotFoundError, StorageError."""
    return stored_answers.unpack(repository.log_with_answer(session, log_id).answer)


def log_view(row: AnalysedLogRow) -> AnalysedLog:
    title = AUTOPILOTS[row.autopilot].title
    return AnalysedLog.view_of(row, autopilot=title, numbers=LogNumbers.model_validate(row.numbers))


def _place(session: Session, row: AnalysedLogRow, stored: StoredAnswer) -> LogPlace:
    known = _known(session, row)
    suggested = known.name if known else fleet.name_of_hardware(session, row.hardware_id) or row.vehicle_name
    return LogPlace(
        **dict(log_view(row)),
        suggested_name=suggested,
        is_recognised=known is not None,
        previous_id=repository.log_before(session, row),
        starts_campaign=stored.definition is not None or (row.file_bytes > 0 and stored.answer.tuning.starts_campaign),
    )


def _known(session: Session, row: AnalysedLogRow) -> LoggedVehicleRow | None:
    return repository.vehicle_of_hardware_or_none(session, row.hardware_id) if row.hardware_id else None


def _forget_without_logs(session: Session, vehicle: LoggedVehicleRow | None) -> None:
    if vehicle is not None and not repository.logs_of(session, vehicle.id):
        session.delete(vehicle)
