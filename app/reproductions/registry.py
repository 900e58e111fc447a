"""Registry of reproductions: what each shows in the paper, and how it is run here.

The modules that run them are imported on use, so that listing them needs none.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
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


_ALL: Final = (
    Reproduction(
        name="f16",
        title="Figs. 2, 3 and 4: the F-16",
        line="The same method on an inaccurate model of an F-16 whose true model is known, compared with four "
        "other methods over many such models.",
        paper="Nelder–Mead finds the optimum of the inaccurate model. Flights of the true model then improve on "
        "it, most in the first step, and come close to the optimum after 16 of 27.",
        figures={
            "figure2-left": "Fig. 2, left",
            "figure2-right": "Fig. 2, right",
            "figure3-left": "Fig. 3, left",
            "figure3-right": "Fig. 3, right",
            "figure4": "Fig. 4",
        },
        long_form="Methods compared over 50 models instead of 10, the re-identified model also at ±20 and ±80 % "
        "and from noisy logs: takes ten times as long.",
    ),
    Reproduction(
        name="table1",
        title="Table 1 and Fig. 7: the simulated quadrotor",
        line="Every gain set of the table flown on the JSBSim quadrotor, with the figures of Paparazzi's own airframe, "
        "and on the twin; then the paper's method flown as a campaign from both starts.",
        paper="Five simulated takeoffs from the default gains take the error from 0.3775 m to 0.1521 m; four from the "
        "simplex's gains, from 0.1006 m to 0.0940 m.",
        figures={"figure7-left": "Fig. 7, left", "figure7-right": "Fig. 7, right"},
    ),
    Reproduction(
        name="table2",
        title="Table 2 and Fig. 11: the real quadrotor",
        line="Every gain set of the table flown on the twin, which was fitted to this table's errors, without its "
        "scatter, and on the JSBSim quadrotor; then the paper's method flown as a campaign from both starts.",
        paper="Five real takeoffs from the default gains take the error from 0.5102 m to 0.2265 m; three from the "
        "simplex's gains stay at 0.12 m, within the scatter.",
        figures={"figure11-left": "Fig. 11, left", "figure11-right": "Fig. 11, right"},
    ),
    Reproduction(
        name="controller",
        title="Fig. 6: the replica of the controller",
        line="A takeoff recorded from the autopilot's own code, replayed step by step through the replica.",
        paper="The copy of the vertical loop reproduces the autopilot's outputs except for small differences.",
        figures={"figure6-reference": "Fig. 6, above", "figure6-commands": "Fig. 6, below"},
    ),
    Reproduction(
        name="variability",
        title="Fig. 12: takeoffs repeated over a battery",
        line="Two gain sets flown ten times on each of 240 batteries of the twin, 200 steady and 40 fading: scatter, "
        "and trend over the battery.",
        paper="The error scatters by 0.0141 m at the default gains and by 0.0066 m at the tuned ones; there is "
        "no trend over the battery.",
        figures={"figure12": "Fig. 12"},
    ),
)

REPRODUCTIONS: Final[Mapping[str, Reproduction]] = {each.name: each for each in _ALL}


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
