"""Chart style of all figures: colour roles for both themes, fonts, axes, margins."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import TypeAdapter

ThemeName = Literal["light", "dark"]
MOST_TICKS: Final = 12
"""On an axis of flight numbers."""
FONT: Final = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'DejaVu Sans', sans-serif"


MARGIN_PX: Final[Mapping[str, int]] = {"l": 48, "r": 14, "t": 12, "b": 48}
"""Room for an axis with its title: if a margin grows while drawing, Plotly draws the whole chart a second time."""


SIGNED_MARGIN_PX: Final[Mapping[str, int]] = {**MARGIN_PX, "l": 62, "r": 18}
"""The same for signed numbers on the axis at the left, and a number at the right end of the abscissa."""


_TITLED_GAP: Final = 0.09
"""Height between two panels as a share of the whole: room for the title of the lower one."""


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours by role. Lines keep 3:1 against the surface, text 4.5:1."""

    surface: str
    ink: str
    dim: str
    grid: str
    best: str
    earlier: str
    prediction: str
    bad: str
    gains: tuple[str, ...]

    def axis(self, title: str = "", **more: object) -> dict[str, object]:
        """A plain axis with a title, if there is one: hairline grid, no frame, no zero line."""
        text = {"text": title} if title else {}
        return {
            "gridcolor": self.grid,
            "linecolor": self.grid,
            "zeroline": False,
            "ticks": "",
            "automargin": True,
            "ticklabeloverflow": "allow",
            "title": {**text, "font": {"size": 13, "color": self.dim}, "standoff": 8},
            "tickfont": {"size": 12, "color": self.dim},
            **more,
        }

    def layout(self, **more: object) -> dict[str, object]:
        """The base layout of every figure."""
        return {
            "font": {"family": FONT, "size": 13, "color": self.ink},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "margin": dict(MARGIN_PX),
            "hovermode": "closest",
            "hoverlabel": {
                "bgcolor": self.surface,
                "bordercolor": self.dim,
                "font": {"family": FONT, "size": 13, "color": self.ink},
            },
            "legend": {
                "orientation": "h",
                "x": 0,
                "y": 1.02,
                "yanchor": "bottom",
                "xanchor": "left",
                "font": {"size": 12, "color": self.ink},
                "bgcolor": "rgba(0,0,0,0)",
                "tracegroupgap": 0,
                "itemwidth": 40,  # two dashes of the longest style
                "itemclick": "toggleothers",
                "itemdoubleclick": "toggle",
            },
            "dragmode": "zoom",
            "modebar": {"orientation": "v", "bgcolor": "rgba(0,0,0,0)", "color": self.dim, "activecolor": self.ink},
            **more,
        }

    def line_of(self, standing: str) -> dict[str, object]:
        """The line of a flight with this standing (see `History.standing_of`), or of the `prediction`."""
        return {
            "best": line(self.best, 3),
            "latest": line(self.ink, 2),
            "baseline": line(self.earlier, 1.75, "longdash"),
            "prediction": line(self.prediction, 2.25, "dash"),
            "earlier": line(self.earlier, 1.25),
            "invalid": line(self.bad, 1.25, "dot"),
            "unjudged": line(self.ink, 2, "longdash"),
        }[standing]

    def panel_axes(
        self,
        place: tuple[int, int, float],
        x_title: str,
        x: Mapping[str, object],
        y_title: str = "",
        **y: object,
    ) -> dict[str, object]:
        """The axes of one of stacked panels, at the `place` that `stacked` takes. Of the abscissae only the lowest has
        labels, and the others follow the first."""
        index, count, _ = place
        own, is_lowest = suffix(index), index == count
        follows = {"matches": "x"} if index > 1 else {}
        across = {"showticklabels": is_lowest, "anchor": f"y{own}", **x, **follows}
        return {
            f"xaxis{own}": self.axis(x_title if is_lowest else "", **across),
            f"yaxis{own}": self.axis(y_title, domain=stacked(*place), anchor=f"x{own}", **y),
        }

    def titled_panels(
        self, x_title: str, x: Mapping[str, object], panels: Sequence[tuple[dict[str, object], dict[str, Any]]]
    ) -> dict[str, object]:
        """The layout of stacked panels with a note above each: `panels` are the notes, and what is special to the
        ordinates."""
        axes: dict[str, object] = {}
        annotations = []
        for index, (note, y) in enumerate(panels, start=1):
            place = (index, len(panels), _TITLED_GAP)
            axes |= self.panel_axes(place, x_title, x, **y)
            annotations.append(note | {"y": stacked(*place)[1]})
        return {
            "showlegend": False,
            "margin": {**MARGIN_PX, "t": 24, "r": 30},
            "annotations": annotations,
        } | axes

    def note(self, text: str, **more: object) -> dict[str, object]:
        """A text at the left edge."""
        edge: dict[str, object] = {"x": 0, "xref": "paper", "yref": "paper", "yanchor": "bottom"}
        return label(text, self.dim, **edge | more)


PALETTES: Final = TypeAdapter(Mapping[ThemeName, Palette]).validate_python(
    tomllib.loads((Path(__file__).parent / "palettes.toml").read_text("utf-8"))
)


def with_opacity(colour: str, opacity: float) -> str:
    """A hex colour as rgba with an opacity."""
    red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def mixed(colour: str, ground: str, share: float) -> str:
    """The opaque hex colour of `colour` with opacity `share` over `ground`."""
    pairs = [(int(colour[at : at + 2], 16), int(ground[at : at + 2], 16)) for at in (1, 3, 5)]
    return "#" + "".join(f"{round(share * one + (1.0 - share) * other):02x}" for one, other in pairs)


def solid(colour: str | list[str], **more: object) -> dict[str, object]:
    """A filled mark in full colour; by default Plotly makes marks of varying size translucent and outlined."""
    return {"color": colour, "opacity": 1, "line": {"width": 0}, **more}


def bars(colour: str, thickness: float, width: float, **length: object) -> dict[str, object]:
    """Error bars, with caps of a `width`."""
    return {"color": colour, "thickness": thickness, "width": width, **length}


def line(colour: str, width: float, dash: str = "solid") -> dict[str, object]:
    return {"color": colour, "width": width, "dash": dash, "simplify": False}


def suffix(index: int) -> str:
    """What follows `x`, `y`, `xaxis` or `yaxis` in the name of the axis at an index from 1."""
    return "" if index == 1 else str(index)


def on(index: int) -> dict[str, object]:
    """The axes of a trace in the panel at an index from 1."""
    return {"xaxis": f"x{suffix(index)}", "yaxis": f"y{suffix(index)}"}


def stacked(index: int, count: int, gap: float) -> list[float]:
    """Bottom and top of one of `count` panels as shares of the whole; the first one, 1, is on top."""
    height = (1 - gap * (count - 1)) / count
    top = 1 - (index - 1) * (height + gap)
    return [max(0.0, top - height), top]


def flight_ticks(last: int) -> dict[str, object]:
    """An axis of flight numbers up to `last`: a dozen ticks at most, at round numbers; no grid."""
    steps = (digit * 10**power for power in range(7) for digit in (1, 2, 5))
    return {
        "range": [0.5, last + 0.6],
        "tick0": 0,
        "dtick": next(step for step in steps if last <= MOST_TICKS * step),
        "showgrid": False,
    }


def label(text: str, colour: str, **place: object) -> dict[str, object]:
    """A text that begins at a place."""
    return {"text": text, "xanchor": "left", "showarrow": False, "font": {"size": 12, "color": colour}, **place}


def upright(at: float, colour: str, width: float, **axes: object) -> dict[str, object]:
    """A dotted vertical line behind the curves, from the bottom to the top of these axes."""
    return {
        "type": "line",
        "x0": at,
        "x1": at,
        "y0": 0,
        "y1": 1,
        "layer": "below",
        "line": {"color": colour, "width": width, "dash": "dot"},
        **axes,
    }
