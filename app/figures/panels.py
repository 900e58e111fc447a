"""Stacked panels: the basis of the figures for publications, and of a recorded vertical loop beside its replica, signal
by signal (the paper's Fig. 6).
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from app.figures import theme
from app.figures.base import Card, Cell, Column, Figure, Table, Trace, scatter

Style = Literal[
    "goal", "reference", "measured", "before", "after", "model", "recorded", "replica", "differs", "mean", "spread",
    "run 1", "run 2", "run 3", "run 4", "run 5", "run 6",
]  # fmt: skip
"""Role of a line. Each style differs from the others in dash or width too, not in colour alone."""

GAP: Final = 0.1
TABLE_ROWS: Final = 33
SEPARATE: Final = 60
"""Up to this number of abscissae, each has its own row in the table; with more, rows are spaced evenly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line or row of marks: `x` and `y` of the same length; `note` is shown on hover."""

    name: str
    style: Style
    x: tuple[float, ...]
    y: tuple[float, ...]
    marks: bool = False
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One pair of axes with its lines, drawn in order; `digits` is the number of decimals in tables and hover text."""

    y_title: str
    lines: tuple[Line, ...]
    y_range: tuple[float, float] | None = None
    digits: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """Panels with a common abscissa, whose ticks are `x_step` apart if it is not None. `summary` describes them in a
    sentence."""

    title: str
    summary: str
    x_title: str
    panels: tuple[Panel, ...]
    x_range: tuple[float, float] | None = None
    x_digits: int = 1
    x_step: int | None = None


@dataclass(frozen=True, slots=True)
class PanelsFigure(Figure):
    """Table columns: `x`, then one for each line of each panel.

    Every trace carries `meta`: `role` is its style, `panel` its position from 1, `line` its name.
    """

    plot: Plot
    name = "panels"

    @property
    def title(self) -> str:
        return self.plot.title

    def not_ready(self) -> str | None:
        return None if any(panel.lines for panel in self.plot.panels) else "Nothing to draw."

    def compute(self) -> Card:
        plot = self.plot
        axes: dict[str, object] = {}
        traces: list[Trace] = []
        named: set[str] = set()
        for number, panel in enumerate(plot.panels, start=1):
            axes |= self._axes(number, panel)
            for line in panel.lines:
                traces.append(self._trace(number, panel, line, in_legend=line.name not in named))
                named.add(line.name)
        return self.ready(
            traces,
            summary=plot.summary,
            table=self._table(),
            uirevision=plot.title,
            showlegend=len(named) > 1,
            **axes,
        )

    def _trace(self, number: int, panel: Panel, line: Line, *, in_legend: bool) -> Trace:
        colour, width, dash = _pen(self.palette, line.style)
        drawn: dict[str, object] = (
            {"mode": "markers", "marker": theme.solid(colour, size=7), "cliponaxis": False}
            if line.marks
            else {"mode": "lines", "line": theme.line(colour, width, dash)}
        )
        note = f"<br>{line.note}" if line.note else ""
        return (
            scatter(
                line.name,
                (list(line.x), list(line.y)),
                role=line.style,
                about={"panel": number, "line": line.name},
                legendgroup=line.name,
                showlegend=in_legend,
                hovertemplate=f"<b>{line.name}</b><br>%{{x}} · %{{y:.{panel.digits}f}}{note}<extra></extra>",
            )
            | theme.on(number)
            | drawn
        )

    def _axes(self, number: int, panel: Panel) -> dict[str, object]:
        count = len(self.plot.panels)
        x = {"dtick": self.plot.x_step} | ({} if self.plot.x_range is None else {"range": list(self.plot.x_range)})
        y = {} if panel.y_range is None else {"range": list(panel.y_range)}
        return self.palette.panel_axes(
            (number, count, GAP),
            self.plot.x_title,
            x,
            panel.y_title,
            nticks=7 if count == 1 else 4,
            **y,
        )

    def _table(self) -> Table:
        panels = self.plot.panels
        drawn = [(number, panel, line) for number, panel in enumerate(panels, start=1) for line in panel.lines]
        columns = (
            Column("x", self.plot.x_title, digits=self.plot.x_digits),
            *(
                Column(
                    f"panel_{number}_{place}",
                    f"{panel.y_title}: {line.name}" if len(panels) > 1 else line.name,
                    digits=panel.digits,
                )
                for place, (number, panel, line) in enumerate(drawn, start=1)
            ),
        )
        rows = (
            (round(x, 6), *(_at(line, x, panel.digits + 1) for _, panel, line in drawn))
            for x in self._abscissae([line for *_, line in drawn])
        )
        return Table(columns, tuple(rows))

    def _abscissae(self, lines: list[Line]) -> list[float]:
        every = sorted({x for line in lines for x in line.x})
        if len(every) <= SEPARATE:
            return every
        low, high = self.plot.x_range or (every[0], every[-1])
        return [float(x) for x in np.linspace(max(low, every[0]), min(high, every[-1]), TABLE_ROWS)]


def _at(line: Line, x: float, digits: int) -> Cell:
    """Value of the line at `x`, interpolated between its points, or exact for marks; None elsewhere."""
    if line.marks:
        return next((round(y, digits) for at, y in zip(line.x, line.y, strict=True) if at == x), None)
    if not line.x or not line.x[0] <= x <= line.x[-1]:
        return None
    return round(float(np.interp(x, line.x, line.y)), digits)


def _pen(palette: theme.Palette, style: Style) -> tuple[str, float, str]:
    """Colour, width and dash."""
    _, orange, blue = palette.gains
    return {
        "goal": (palette.dim, 1.5, "dot"),
        "reference": (palette.dim, 1.5, "dashdot"),
        "measured": (palette.ink, 2, "solid"),
        "before": (palette.bad, 2, "dash"),
        "after": (palette.best, 2.5, "solid"),
        "model": (palette.prediction, 2, "dash"),
        "recorded": (palette.earlier, 4.5, "solid"),
        "replica": (palette.ink, 1.5, "dash"),
        "differs": (palette.bad, 1, "solid"),
        "mean": (palette.best, 2, "solid"),
        "spread": (palette.dim, 1.25, "dash"),
        "run 1": (palette.ink, 2, "solid"),
        "run 2": (orange, 2, "dash"),
        "run 3": (blue, 2, "dot"),
        "run 4": (palette.prediction, 2, "dashdot"),
        "run 5": (palette.best, 3, "solid"),
        "run 6": (palette.bad, 2, "longdash"),
    }[style]
