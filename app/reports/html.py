"""Rendering of a report as one HTML file, with escaped text and embedded chart library, that makes no requests."""

import base64
import hashlib
import json
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

from markupsafe import Markup

from app.campaigns.schemas import Campaign
from app.campaigns.trials.schemas import Trial
from app.common.conflict_checks import state_label
from app.core import formatting
from app.core.definition import Interval
from app.db.models import TrialPhotoRow
from app.figures.base import Cell, Column
from app.reports.service import WORDS, Report

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES: Final = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class Document:
    """The file, and the content security policy with which a server must send it.

    The policy allows inline scripts by hash, no network, and no origin.
    """

    html: str
    policy: str


def render(report: Report, plotly: str) -> Document:
    """Render a report. `plotly` is the source of the chart library."""
    draw = _script((_TEMPLATES / "draw.js").read_text(encoding="utf-8"))
    library = _script(plotly)
    own = _policy(library, draw)
    groups = report.statistics.groups
    drawn = {card.name: card.figure for card in report.cards if card.state == "ready"}
    html = (
        _environment()
        .get_template("report.html.j2")
        .render(
            report=report,
            state=_state(report.campaign),
            standing=WORDS["standings"].get(report.campaign.standing or ""),
            baseline=next((group for group in groups if group.is_baseline), None),
            winner=next((group for group in groups if group.is_best), None),
            policy=own,
            css=Markup((_TEMPLATES / "report.css").read_text(encoding="utf-8")),  # noqa: S704  # ours
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


def file_name(campaign_id: int, ending: str) -> str:
    """File name of a report."""
    return f"campaign-{campaign_id}-report.{ending}"


def _state(campaign: Campaign) -> str:
    if campaign.state == "finished" and campaign.outcome == "converged" and campaign.verdict is None:
        return "No better gains found"
    if campaign.state == "finished" and campaign.outcome is not None:
        return WORDS["outcomes"][campaign.outcome]
    return WORDS["states"][campaign.state]


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


def _environment() -> "Environment":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True
    )
    environment.filters |= {
        "instant": _instant,
        "choice": lambda kind: WORDS["choices"].get(kind, kind),
        "trial_state": state_label,
        "plus_minus": formatting.measured,
        "number": formatting.number,
        "short": formatting.short,
        "settling_time": _settling_time,
        "interval": _interval,
        "gain": formatting.gain,
        "gains": formatting.format_gains,
        "relative_to": formatting.relative_to,
        "count": formatting.count,
        "flights": formatting.named_flights,
        "cell": _cell,
        "data_uri": _data_uri,
        "mebibytes": lambda size: f"{size / 2**20:g} MiB",
    }
    return environment


def _interval(span: Interval | None) -> str:
    return formatting.NOTHING if span is None else formatting.interval_text(span.lower, span.upper)


def _settling_time(trial: Trial) -> str:
    """`1.34`; of a complete flight without one, that it did not settle."""
    if trial.settling_time_s is None and trial.steady_state_error_m is not None:
        return "not settled"
    return formatting.number(trial.settling_time_s, 2)


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


def _data_uri(photo: TrialPhotoRow) -> Markup:
    return Markup(f"data:{photo.media_type};base64,{base64.b64encode(photo.data).decode()}")  # noqa: S704  # no markup in it


def _cell(value: Cell, column: Column) -> str:
    if value is None:
        return formatting.NOTHING
    if isinstance(value, str):
        return value
    return formatting.gain(value) if column.digits is None else formatting.number(value, column.digits)
