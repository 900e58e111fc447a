"""Operations on logs: analyse one of any autopilot, which stores nothing, and read what a campaign takes of one."""

from typing import TYPE_CHECKING, get_args

from app.figures.base import card_of
from app.figures.panels import PanelsFigure
from app.figures.theme import ThemeName
from app.log_analyses.schemas import LogAnalysis
from app.processes.calls import FILE, run_limited
from app.reproductions.controller import RECORDED_TAKEOFF

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.autopilots.takeoffs import Takeoff
    from app.log_analyses.manoeuvres import CopterStart


def analyze_upload(content: bytes, companion: bytes | None, *, name: str, gains: str = "") -> LogAnalysis:
    """Analyse an uploaded log or trace in a process with limits. `companion` is the .log file of Paparazzi's .data
    file, `gains` those flown, if no log contains them.

    Raises InputError that names what is missing or wrong.
    """
    from app.log_analyses.content import analyze_content  # noqa: PLC0415 - imports every reader and model

    answer, plots = run_limited(FILE, analyze_content, content, companion, name, gains)
    figures = {
        theme: {
            part: [card_of(PanelsFigure(plot, theme_name=theme)) for plot in drawn] for part, drawn in plots.items()
        }
        for theme in get_args(ThemeName)
    }
    return LogAnalysis(**dict(answer), figures=figures)


def analyze_example() -> LogAnalysis:
    """Analyse the takeoff that comes with the program, recorded from the autopilot's own code."""
    return analyze_upload(RECORDED_TAKEOFF.read_bytes(), None, name=RECORDED_TAKEOFF.name)


def read_upload(content: bytes, companion: bytes | None, *, name: str) -> "Sequence[Takeoff] | CopterStart":
    """Read what a campaign starts with from an uploaded log, in a process with limits. Raises InputError that names
    what is missing or wrong."""
    from app.log_analyses.content import read_start  # noqa: PLC0415 - imports every reader and model

    return run_limited(FILE, read_start, content, companion, name)
