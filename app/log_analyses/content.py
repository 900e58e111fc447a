"""Content of an uploaded log, in the process that reads it: its takeoffs, and its analysis."""

import io
from typing import Final

from app.autopilots.ardupilot.flight import ardupilot_flight
from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.copter_tlog import is_copter_tlog, read_copter_tlog
from app.autopilots.paparazzi.log import is_paparazzi
from app.autopilots.px4.flight import px4_flight
from app.autopilots.px4.log import read_px4
from app.autopilots.readers import HEAD_BYTES, read_takeoffs
from app.autopilots.takeoffs import Takeoff
from app.core.analysis.analysis import analyze
from app.core.analysis.flight import LoggedFlight
from app.core.errors import Problem, TrajectoryError
from app.core.tuning.logged_takeoffs import analyze_takeoffs
from app.log_analyses.copter_start import CopterStart, start_of
from app.log_analyses.manoeuvres import AnalysedManoeuvres
from app.log_analyses.takeoffs import AnalysedTakeoffs, logged_takeoffs
from app.logs.dataflash import is_dataflash
from app.logs.tlog_frames import is_tlog
from app.logs.ulog_tables import is_ulog

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
_FLIGHTS: Final = (
    (is_dataflash, lambda stream, *, name: ardupilot_flight(read_ardupilot(stream), name=name)),
    (is_ulog, lambda stream, *, name: px4_flight(read_px4(stream), name=name)),
    (is_copter_tlog, read_copter_tlog),
)


def _read_flight(content: bytes, name: str) -> LoggedFlight | None:
    """The flight of a copter's log; None if this is none."""
    read = next((read for recognises, read in _FLIGHTS if recognises(content)), None)
    return None if read is None else read(io.BytesIO(content), name=name)


def _read_takeoffs(content: bytes, companion: bytes | None, name: str) -> list[Takeoff]:
    """Every takeoff of a Paparazzi log."""
    head = content[:HEAD_BYTES]
    if is_tlog(head) or is_paparazzi(head):
        beside = None if companion is None else io.BytesIO(companion)
        return list(read_takeoffs(io.BytesIO(content), name=name, companion=beside))
    raise TrajectoryError(
        f"{name} cannot be used.", hint=f"Use {ANALYSED}.", problems=(Problem("file", _what_else(head)),)
    )


def _what_else(head: bytes) -> str:
    """What a file with these first bytes is, if it is no log."""
    found = (what for begin, what in _OTHER_FILES if head.startswith(begin))
    return next(found, "is not a log") if head else "is empty"


def read_start(content: bytes, companion: bytes | None, name: str) -> list[Takeoff] | CopterStart:
    """Read what a campaign starts with: the takeoffs of a Paparazzi log, or the gains proposed from a copter's, which
    takes some seconds. Raises InputError that names what is missing or wrong."""
    flight = _read_flight(content, name)
    return _read_takeoffs(content, companion, name) if flight is None else start_of(analyze(flight), name)


def analyze_content(content: bytes, companion: bytes | None, name: str) -> AnalysedManoeuvres | AnalysedTakeoffs:
    """Analyse a log in memory; takes some seconds. Raises InputError that names what is missing or wrong."""
    flight = _read_flight(content, name)
    if flight is not None:
        return AnalysedManoeuvres(analyze(flight), name, flight.assumed)
    found = _read_takeoffs(content, companion, name)
    return AnalysedTakeoffs(analyze_takeoffs(logged_takeoffs(found, name=name)), name)
