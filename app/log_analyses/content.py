"""Content of an uploaded log, in the process that reads it: its takeoffs, and its analysis."""

import io
from collections.abc import Mapping
from typing import Final

from app.autopilots.readers import reader_of
from app.autopilots.takeoffs import Takeoff
from app.core.analysis.analysis import analyze
from app.core.analysis.loop import LoggedFlight
from app.core.errors import Problem, TrajectoryError
from app.core.tuning.logged_takeoffs import analyze_takeoffs
from app.figures.panels import Plot
from app.log_analyses import manoeuvres, takeoffs
from app.log_analyses.schemas import LogAnswer
from app.logs.formats import HEAD_BYTES, Format, recognise

ANALYSED: Final = (
    "ArduCopter's .bin log, PX4's .ulg log, a .tlog of altitude steps under either, or Paparazzi's .data or .tlog log "
    "of a takeoff"
)
_OTHER_FILES: Final[Mapping[Format | None, str]] = {
    Format.GZIP: "is compressed (gzip): unpack it first",
    Format.ZIP: "is an archive (zip): unpack it first",
    Format.DATAFLASH_TEXT: "is a .bin log converted to text: use the .bin itself",
}


def _read(content: bytes, companion: bytes | None, name: str) -> LoggedFlight | list[Takeoff]:
    """The flight of a copter's log, or every takeoff of a Paparazzi log."""
    head = content[:HEAD_BYTES]
    reader = reader_of(head)
    if reader is None:
        what = _OTHER_FILES.get(recognise(head), "is not a log") if head else "is empty"
        raise TrajectoryError(f"{name} cannot be used.", hint=f"Use {ANALYSED}.", problems=(Problem("file", what),))
    recording = reader.read(io.BytesIO(content), None if companion is None else io.BytesIO(companion))
    flight = reader.flight(recording, name)
    return list(reader.takeoffs(recording)) if flight is None else flight


def read_start(content: bytes, companion: bytes | None, name: str) -> list[Takeoff] | manoeuvres.CopterStart:
    """Read what a campaign starts with: the takeoffs of a Paparazzi log, or the gains proposed from a copter's, which
    takes some seconds. Raises InputError that names what is missing or wrong."""
    found = _read(content, companion, name)
    return manoeuvres.start_of(analyze(found), name) if isinstance(found, LoggedFlight) else found


def analyze_content(content: bytes, companion: bytes | None, name: str) -> tuple[LogAnswer, Plot]:
    """The answer of a log in memory, and its figure; takes some seconds. Raises InputError that names what is missing
    or wrong."""
    found = _read(content, companion, name)
    if isinstance(found, LoggedFlight):
        flight = analyze(found)
        return manoeuvres.answer_of(flight, name, found.assumed), manoeuvres.plot_of(flight)
    flown = analyze_takeoffs(takeoffs.logged_takeoffs(found, name=name))
    return takeoffs.answer_of(flown, name), takeoffs.plot_of(flown)
