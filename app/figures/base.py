"""Interface of figures, and the card on which a page, report or notebook shows one."""

import html
import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, Literal

from pydantic import with_config

from app.figures.data import Curve, History
from app.figures.theme import PALETTES, Palette, ThemeName

Cell = str | int | float | None
Trace = dict[str, object]

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a data table.

    `digits` is the number of decimals, None for text and for numbers of any size, which are shown with four significant
    digits.
    """

    name: str
    title: str
    unit: str = ""
    digits: int | None = None


@dataclass(frozen=True, slots=True)
class Table:
    """The data of the figure as a table, for those who cannot see it or want the numbers."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


@with_config(json_schema_serialization_defaults_required=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """A figure, in Plotly's own JSON, with its table and a one-sentence summary; the API sends it as it is.

    `waiting`: there is nothing to draw yet, `reason` says what is missing. `failed`: drawing failed, `reason` says how.
    """

    name: str
    title: str
    state: Literal["ready", "waiting", "failed"]
    summary: str = ""
    reason: str = ""
    figure: Mapping[str, object] | None = None
    table: Table | None = None


@dataclass(frozen=True, slots=True)
class Figure(ABC):
    """One figure over plain data, without any other input but the theme."""

    theme_name: ThemeName = field(default="light", kw_only=True)
    name: ClassVar[str]

    @property
    @abstractmethod
    def title(self) -> str: ...

    def not_ready(self) -> str | None:
        """Why there is nothing to draw yet, or None."""
        return None

    @abstractmethod
    def compute(self) -> Card: ...

    @property
    def palette(self) -> Palette:
        return PALETTES[self.theme_name]

    def ready(self, traces: Sequence[Trace], *, summary: str, table: Table, **layout: object) -> Card:
        """The card of a figure that could be drawn, with its part of the layout. The browser keeps what a person chose
        in the figure of the same name (`uirevision`).
        """
        whole = self.palette.layout(**{"uirevision": self.name, **layout})
        return Card(
            name=self.name,
            title=self.title,
            state="ready",
            summary=summary,
            figure={"data": list(traces), "layout": whole},
            table=table,
        )


@dataclass(frozen=True, slots=True)
class CampaignFigure(Figure):
    """A figure of a campaign."""

    history: History


def card_of(figure: Figure) -> Card:
    """Compute the figure's card; one that is not ready, or raises, yields a card that reports it, not an exception."""
    try:
        if (missing := figure.not_ready()) is not None:
            return Card(name=figure.name, title=figure.title, state="waiting", reason=missing)
        return figure.compute()
    except Exception:
        logger.exception("figure %s failed", figure.name)
        return Card(
            name=figure.name,
            title=figure.title,
            state="failed",
            reason="This figure could not be drawn. No data is lost; see the server's log.",
        )


def scatter(
    name: str,
    points: tuple[Sequence[object], Sequence[object]],
    *,
    role: str,
    about: Mapping[str, object] = MappingProxyType({}),
    mode: str = "lines",
    **more: object,
) -> Trace:
    """A line or marks at `points`, x and y, by default without hover text.

    `role`, and what else the trace is `about`, are its `meta`.
    """
    return {
        "type": "scatter",
        "mode": mode,
        "name": name,
        "x": points[0],
        "y": points[1],
        "meta": {"role": role, **about},
        **({} if "hovertemplate" in more else {"hoverinfo": "skip"}),
        **more,
    }


def reading(title: str, unit: str, note: str = "", *, form: str = ".3f") -> str:
    """Hover text of a curve over time: its title, time and value, and a note below them."""
    values = f"%{{x:.2f}} s · %{{y:{form}}} {unit}".rstrip()
    return f"<b>{title}</b><br>{values}{note}<extra></extra>"


NamedCurve = tuple[str, str, Curve | None]
"""A curve of a table, if there is one, with the name and the title of its column."""


def table_of_curves(
    times_s: Sequence[float], digits: int, unit: str, curves: Sequence[NamedCurve], others: Sequence[NamedCurve] = ()
) -> Table:
    """The values of curves in a unit, and of others without one, at these times, of which `digits` decimals are
    shown."""
    with_units = [*((unit, *named) for named in curves), *(("", *named) for named in others)]
    known = [(Column(name, title, own, 3), curve) for own, name, title, curve in with_units if curve is not None]
    rows = []
    for time_s in times_s:
        values = [curve.at(time_s) for _, curve in known]
        rows.append((round(time_s, digits), *(None if value is None else round(value, 4) for value in values)))
    return Table((Column("time_s", "Time", "s", digits), *(column for column, _ in known)), tuple(rows))


def literal(text: str) -> str:
    """Escape user text for a trace's name or hover text, so that Plotly finds neither markup nor templates in it."""
    return html.escape(text, quote=False).replace("%{", "%&#123;")
