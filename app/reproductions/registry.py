"""Registry of reproductions: what each shows in the paper, and how it is run here.

The modules that run them are imported on use, so that listing them needs none.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from app.processes import follow_parent, perform
from app.reproductions.results import Progress, Result

NICENESS: Final = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """One experiment, table or figure of the paper.

    `line` describes what is done here, `paper` what the paper shows. `figures` names the figures of a result in order,
    with the paper's name for each. `long_form` describes the long form, if there is one.
    """

    name: str
    title: str
    line: str
    paper: str
    figures: Mapping[str, str]
    long_form: str = ""

    def run(self, on_progress: Progress, full: bool) -> Result:
        """Pure: the same result every time; `full` requests the long form, which exists if `long_form` is not empty."""
        from app.reproductions import controller, f16, tables, variability  # noqa: PLC0415

        match self.name:
            case "f16":
                return f16.run_f16(on_progress, full)
            case "controller":
                return controller.run_controller(on_progress)
            case "variability":
                return variability.run_variability(on_progress)
            case _:
                figure, _, _ = next(iter(self.figures)).partition("-")
                return tables.run_table(self.name, figure, on_progress)


REPRODUCTIONS: Final[Mapping[str, Reproduction]] = {
    name: Reproduction(name=name, **described)
    for name, described in tomllib.loads((Path(__file__).parent / "reproductions.toml").read_text("utf-8")).items()
}


@dataclass(frozen=True, slots=True)
class ProgressReport:
    """Message of the process that computes: the share done, 0 … 1, and the current activity."""

    share: float
    doing: str


def reproduce(pipe: Connection, name: str, full: bool) -> None:
    """Main function of a low-priority process: compute one reproduction, and send ProgressReports, then the outcome."""
    follow_parent(NICENESS)
    pipe.send(
        perform(lambda: REPRODUCTIONS[name].run(lambda share, doing: pipe.send(ProgressReport(share, doing)), full))
    )
