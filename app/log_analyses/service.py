"""Operations on logs: analyse one of any autopilot, which stores nothing, and read what a campaign takes of one."""

from typing import TYPE_CHECKING, get_args

from app.figures.base import card_of
from app.figures.panels import PanelsFigure
from app.figures.theme import ThemeName
from app.log_analyses.schemas import LogAnalysis
from app.processes.calls import FILE, run_limited

if TYPE_CHECKING:
    from app.autopilots.takeoffs import Takeoff
    from app.log_analyses.manoeuvres import CopterStart


def analyze_upload(content: bytes, companion: bytes | None, *, name: str) -> LogAnalysis:
    """Analyse an uploaded log in a process with limits. `companion` is the .log file of Paparazzi's .data file.

    Raises InputError that names what is missing or wrong.
    """
    from app.log_analyses.content import analyze_content  # noqa: PLC0415 - imports every reader and model

    answer, plot = run_limited(FILE, analyze_content, content, companion, name)
    figures = {theme: card_of(PanelsFigure(plot, theme)) for theme in get_args(ThemeName)}
    return LogAnalysis(**dict(answer), figures=figures)


def read_upload(content: bytes, companion: bytes | None, *, name: str) -> "list[Takeoff] | CopterStart":
    """Read what a campaign starts with from an uploaded log, in a process with limits. Raises InputError that names
    what is missing or wrong."""
    from app.log_analyses.content import read_start  # noqa: PLC0415 - imports every reader and model

    return run_limited(FILE, read_start, content, companion, name)
