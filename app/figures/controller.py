"""A recorded vertical loop and its replica, signal by signal: the paper's Fig. 6."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from app.figures.base import Card
from app.figures.panels import Line, Panel, PanelsFigure, Plot
from app.figures.theme import ThemeName

Curve = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlaid:
    """One signal over time, recorded and from the replica, of equal length.

    `differing_s` and `differing` are time and value of each mark where the recorded signal differs.
    """

    label: str
    digits: int
    time_s: Curve
    recorded: Curve
    replica: Curve
    differing_s: Curve = ()
    differing: Curve = ()


@dataclass(frozen=True, slots=True)
class ControllerFigure:
    """One panel per signal over a common time axis.

    Traces as in `PanelsFigure`, with the roles `recorded`, `replica` and `differs`.
    """

    signals: Sequence[Overlaid]
    heading: str
    summary: str
    theme: ThemeName = "light"
    name: ClassVar[str] = "controller"

    @property
    def title(self) -> str:
        return self.heading

    def not_ready(self) -> str | None:
        return None if self.signals else "The log holds no command that could be simulated again."

    def compute(self) -> Card:
        plot = Plot(
            title=self.heading,
            summary=self.summary,
            x_title="Time in the recording (s)",
            panels=tuple(
                Panel(y_title=signal.label, digits=signal.digits, lines=_lines(signal)) for signal in self.signals
            ),
        )
        return PanelsFigure(plot, self.theme).compute()


def _lines(signal: Overlaid) -> tuple[Line, ...]:
    both = (
        Line(name="Recorded", style="recorded", x=signal.time_s, y=signal.recorded),
        Line(name="Replica", style="replica", x=signal.time_s, y=signal.replica),
    )
    if not signal.differing:
        return both
    return (
        *both,
        Line(name="Differs", style="differs", x=signal.differing_s, y=signal.differing, marks=True),
    )
