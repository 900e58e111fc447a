"""Flight records on disk before they are in the database, so that neither a full disk nor a crash loses a flight.

Disk space for the record is reserved before lift-off: a flight whose record would not fit does not start.
"""

import hashlib
import io
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from app.common.errors import InputError, StorageError
from app.core.records.trajectory import Trajectory
from app.db.base import FLIGHT_END
from app.db.earlier_ends import landing_of, read_end
from app.vehicles.base import FlightRecord

RESERVED_BYTES: Final = 4 * 2**20
"""Reserved before each flight; a takeoff at 512 Hz leaves about 0.6 MB."""
_UNFINISHED: Final = ".claimed"
_FINISHED: Final = ".flight"


@dataclass(frozen=True, slots=True)
class Spool:
    """The spool folder: one file per flight, either complete or absent."""

    folder: Path

    def reserve(self, flight_id: int) -> None:
        """Reserve the disk space for one record. Raises StorageError when there is not enough."""
        path = self._path(flight_id, _UNFINISHED)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with path.open("wb") as file:
                os.posix_fallocate(file.fileno(), 0, RESERVED_BYTES)
        except OSError as error:
            with suppress(OSError):
                path.unlink(missing_ok=True)
            raise StorageError(
                f"There is no space for the flight record in {self.folder}: {error.strerror}.",
                hint=f"Free at least {2 * RESERVED_BYTES // 2**20} MB there, then fly again. The vehicle has not "
                "moved.",
            ) from error

    def write(self, flight_id: int, record: FlightRecord) -> None:
        """Write a record into its reserved space; from then on it survives a crash. Raises StorageError when it does
        not fit."""
        path = self._path(flight_id, _UNFINISHED)
        try:
            with path.open("r+b") as file:
                file.write(_pack(flight_id, record))
                file.truncate()
                os.fsync(file.fileno())
            path.replace(self._path(flight_id, _FINISHED))
            _sync_folder(self.folder)
        except (OSError, ValueError, TypeError) as error:
            raise StorageError(
                f"The record of flight {flight_id} could not be written to {path}: {error}.",
                hint="Free some space there; the worker keeps trying while it runs.",
            ) from error

    def flight_ids(self) -> list[int]:
        """Flights whose records are in the spool."""
        return sorted(int(path.stem) for path in self.folder.glob(f"*{_FINISHED}"))

    def read(self, flight_id: int) -> FlightRecord:
        """Read a record. Raises InputError when the file is damaged or cannot be read."""
        path = self._path(flight_id, _FINISHED)
        try:
            return _unpack(path.read_bytes())
        except (OSError, ValueError, KeyError) as error:
            raise InputError(
                f"The record {path} cannot be read: {error}.",
                hint="Keep the file for inspection; the trial stays lost until it is reviewed.",
            ) from error

    def delete(self, flight_id: int) -> None:
        """Free the space, because the record is in the database or the flight did not begin.

        A file that cannot be removed now is removed at the next start; recovering a record twice is harmless.
        """
        for suffix in (_UNFINISHED, _FINISHED):
            with suppress(OSError):
                self._path(flight_id, suffix).unlink(missing_ok=True)

    def set_aside(self, flight_id: int) -> str | None:
        """Rename a record that cannot be used, to keep it out of the way; returns its new path, or None if it is not
        here."""
        path = self._path(flight_id, _FINISHED)
        try:
            return str(path.replace(path.with_suffix(".unusable")))
        except FileNotFoundError:
            return None

    def delete_unfinished(self) -> None:
        """Free the reserved space of flights that left no record. Call it only while nothing flies."""
        for path in self.folder.glob(f"*{_UNFINISHED}"):
            path.unlink(missing_ok=True)

    def _path(self, flight_id: int, suffix: str) -> Path:
        return self.folder / f"{flight_id}{suffix}"


def _pack(flight_id: int, record: FlightRecord) -> bytes:
    trajectory = record.trajectory
    header = {
        "flight_id": flight_id,
        "ending": record.ending,
        "end": asdict(record.end),
        "settings": dict(record.settings),
        "source": trajectory.source,
        "clock": trajectory.clock,
        "channels": list(trajectory.channels),
    }
    table = io.BytesIO()
    np.save(table, np.vstack([trajectory.time_s, *trajectory.channels.values()]), allow_pickle=False)
    body = json.dumps(header).encode() + b"\n" + table.getvalue()
    return hashlib.sha256(body).hexdigest().encode() + b"\n" + body


def _unpack(content: bytes) -> FlightRecord:
    digest, _, body = content.partition(b"\n")
    if hashlib.sha256(body).hexdigest().encode() != digest:
        raise ValueError("its checksum is wrong")
    line, _, table = body.partition(b"\n")
    header = json.loads(line)
    time_s, *values = np.load(io.BytesIO(table), allow_pickle=False)
    channels = dict(zip(header["channels"], values, strict=True))
    return FlightRecord(
        trajectory=Trajectory(time_s, channels, header["source"], header["clock"]),
        ending=header["ending"],
        end=FLIGHT_END.validate_python(header["end"] if "end" in header else _earlier_end(header)),
        settings=header["settings"],
    )


def _earlier_end(header: Mapping[str, Any]) -> Any:
    """The end of a flight whose worker was of a version before 0.4.0."""
    asked, landed = header.get("on_request", False), landing_of(header["settings"])
    return read_end(header["reason"], on_request=asked, landed=landed)


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
