"""Rendering of a document as one HTML file, with escaped text and embedded chart library, that makes no requests."""

import base64
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

from markupsafe import Markup

from app import __version__
from app.core import formatting
from app.figures.base import Card, Cell, Column

if TYPE_CHECKING:
    from jinja2 import Environment

Filters = Mapping[str, Callable[..., object]]
_TEMPLATES: Final = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class Document:
    """The file, and the content security policy with which a server must send it.

    The policy allows inline scripts by hash, no network, and no origin.
    """

    html: str
    policy: str


def render(
    template: Path, cards: Iterable[Card], plotly: str, filters: Filters, content: Mapping[str, object]
) -> Document:
    """Render a template that extends `document.html.j2`, with its `content` and further `filters`.

    `cards` are those that it shows with `figure`, of different names; `plotly` is the source of the chart library.
    """
    draw = _script((_TEMPLATES / "draw.js").read_text(encoding="utf-8"))
    library = _script(plotly)
    own = _policy(library, draw)
    drawn = {card.name: card.figure for card in cards if card.state == "ready"}
    html = (
        _environment(template.parent, filters)
        .get_template(template.name)
        .render(
            content,
            version=__version__,
            policy=own,
            css=Markup((_TEMPLATES / "document.css").read_text(encoding="utf-8")),  # noqa: S704  # ours
            figures=Markup(json.dumps(drawn, ensure_ascii=False).replace("<", "\\u003c")),  # noqa: S704  # no `<` is left
            plotly=library,
            draw=draw,
        )
    )
    return Document(html, f"{own}; frame-ancestors 'none'; sandbox allow-scripts")


@lru_cache(maxsize=2)
def chart_library(ui_dir: Path) -> str:
    """Source of the chart library: the one of the built dashboard, or else the larger one of the plotly package."""
    shipped = ui_dir / "report/plotly-cartesian.min.js"
    if shipped.is_file():
        return shipped.read_text(encoding="utf-8")
    from plotly.offline import get_plotlyjs  # five megabytes, needed only without a dashboard

    source: str = get_plotlyjs()
    return source


def _script(source: str) -> Markup:
    """Source that is safe between script tags without escaping."""
    if "</script" in source.lower() or "<!--" in source:
        raise ValueError("this script would end early inside a page")
    return Markup(source)  # noqa: S704  # ours and the library's, checked above


def _policy(*scripts: Markup) -> str:
    """The content security policy.

    The chart library writes its own style rules, so inline styles cannot be allowed by hash.
    """
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(each.encode()).digest()).decode()}'" for each in scripts
    )
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _environment(folder: Path, filters: Filters) -> "Environment":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    made = Environment(loader=FileSystemLoader([folder, _TEMPLATES]), autoescape=True, undefined=StrictUndefined)
    made.filters |= {"instant": _instant, "number": formatting.number, "count": formatting.count, "cell": _cell}
    made.filters |= filters
    return made


def _instant(at: datetime | None) -> str:
    """`22 Nov 2026, 14:03 CET (13:03 UTC)` in this machine's time zone; UTC alone if the zone is at UTC."""
    if at is None:
        return formatting.NOTHING
    here = at.astimezone()
    there = at.astimezone(UTC)
    local = f"{here.day} {here:%b %Y, %H:%M}"
    if not here.utcoffset():
        return f"{local} UTC"
    utc = f"{there:%H:%M}" if there.date() == here.date() else f"{there.day} {there:%b, %H:%M}"
    return f"{local} {here.tzname()} ({utc} UTC)"


def _cell(value: Cell, column: Column) -> str:
    if value is None:
        return formatting.NOTHING
    if isinstance(value, str):
        return value
    return formatting.gain(value) if column.digits is None else formatting.number(value, column.digits)
