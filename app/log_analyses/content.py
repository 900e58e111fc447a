"""Content of an uploaded log, in the process that reads it: its takeoffs, and its analysis."""

import io
from typing import Final

from app.autopilots.readers import HEAD_BYTES, reader_of
from app.autopilots.takeoffs import Takeoff
from app.core.analysis.analysis import analyze
from app.core.analysis.flight import LoggedFlight
from app.core.errors import Problem, TrajectoryError
from app.core.tuning.logged_takeoffs import analyze_takeoffs
from app.log_analyses.copter_start import CopterStart, start_of
from app.log_analyses.manoeuvres import AnalysedManoeuvres
from app.log_analyses.takeoffs import AnalysedTakeoffs, logged_takeoffs

ANALYSED: Final = (
    "ArduCopter's .bin log, PX4's .ulg log, a .tlog of altitude steps under either, or Paparazzi's .data or .tlog log "
    "of a takeoff"
)
_OTHER_FILES: Final = (
    (b"\x1f\x8b", "is compressed (gzip): unpack it first"),
    (b"PK\x03\x04", "is an archive (zip): unpack it first"),
    (b"FMT, ", "is a .bin log converted to text: use the .bin itself"),
)
"""First bytes of files that are no log, but contain one."""


def _read(content: bytes, companion: bytes | None, name: str) -> LoggedFlight | list[Takeoff]:
    """The flight of a copter's log, or every takeoff of a Paparazzi log."""
    head = content[:HEAD_BYTES]
    reader = reader_of(head)
    if reader is None:
        raise TrajectoryError(
            f"{name} cannot be used.", hint=f"Use {ANALYSED}.", problems=(Problem("file", _what_else(head)),)
        )
    recording = reader.read(io.BytesIO(content), None if companion is None else io.BytesIO(companion))
    flight = reader.flight(recording, name)
    return list(reader.takeoffs(recording)) if flight is None else flight


def _what_else(head: bytes) -> str:
    """What a file with these first bytes is, if it is no log."""
    found = (what for begin, what in _OTHER_FILES if head.startswith(begin))
    return next(found, "is not a log") if head else "is empty"


def read_start(content: bytes, companion: bytes | None, name: str) -> list[Takeoff] | CopterStart:
    """Read what a campaign starts with: the takeoffs of a Paparazzi log, or the gains proposed from a copter's, which
    takes some seconds. Raises InputError that names what is missing or wrong."""
    found = _read(content, companion, name)
    return start_of(analyze(found), name) if isinstance(found, LoggedFlight) else found


def analyze_content(content: bytes, companion: bytes | None, name: str) -> AnalysedManoeuvres | AnalysedTakeoffs:
    """Analyse a log in memory; takes some seconds. Raises InputError that names what is missing or wrong."""
    found = _read(content, companion, name)
    if isinstance(found, LoggedFlight):
        return AnalysedManoeuvres(analyze(found), name, found.assumed)
    return AnalysedTakeoffs(analyze_takeoffs(logged_takeoffs(found, name=name)), name)
