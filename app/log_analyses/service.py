"""Operations on log analyses: analyse a log of any autopilot. Nothing is stored."""

import io
from typing import Final, get_args

from app.common.schemas import figure_card
from app.core.analysis.analysis import analyze
from app.core.analysis.takeoffs import analyze_takeoffs
from app.core.errors import Problem, TrajectoryError
from app.figures.base import card_of
from app.figures.panels import PanelsFigure
from app.figures.theme import ThemeName
from app.log_analyses.manoeuvres import AnalysedManoeuvres
from app.log_analyses.schemas import LogAnalysis
from app.log_analyses.takeoffs import AnalysedTakeoffs, logged_takeoffs
from app.logs.ardupilot_flight import read_ardupilot_flight
from app.logs.dataflash import is_dataflash
from app.logs.paparazzi import is_paparazzi
from app.logs.readers import HEAD_BYTES, READERS, read_takeoffs
from app.logs.tlog import is_tlog
from app.processes.sandbox import FILE, run_limited

ANALYSED: Final = "ArduCopter's .bin log, or Paparazzi's .data or .tlog log of a takeoff"


def analyze_upload(content: bytes, companion: bytes | None, *, name: str) -> LogAnalysis:
    """Analyse an uploaded log in a process with limits. `companion` is the .log file of Paparazzi's .data file.

    Raises InputError that names what is missing or wrong.
    """
    analysed = run_limited(FILE, analyze_content, content, companion, name)
    figures = {theme: figure_card(card_of(PanelsFigure(analysed.plot, theme))) for theme in get_args(ThemeName)}
    return LogAnalysis(**dict(analysed.answer), figures=figures)


def analyze_content(content: bytes, companion: bytes | None, name: str) -> AnalysedManoeuvres | AnalysedTakeoffs:
    """Analyse a log in memory; takes some seconds. Raises InputError that names what is missing or wrong."""
    head, stream = content[:HEAD_BYTES], io.BytesIO(content)
    if is_dataflash(head):
        flight = read_ardupilot_flight(stream, name=name)
        return AnalysedManoeuvres(analyze(flight), name, flight.parameters.hover_throttle)
    if is_tlog(head) or is_paparazzi(head):
        beside = None if companion is None else io.BytesIO(companion)
        found = read_takeoffs(stream, name=name, companion=beside)
        return AnalysedTakeoffs(analyze_takeoffs(logged_takeoffs(found, name=name)), name)
    kind = next((f" ({reader.title})" for reader in READERS if reader.recognises(head)), "")
    other = f"is another kind of log{kind}" if kind else "is not a log" if head else "is empty"
    raise TrajectoryError(
        f"{name} cannot be analysed.",
        hint=f"Use {ANALYSED}. Logs of PX4 are not analysed yet.",
        problems=(Problem("file", other),),
    )
