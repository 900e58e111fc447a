"""Rendering of a report as one HTML file."""

import base64
from pathlib import Path
from typing import Final

from markupsafe import Markup

from app.campaigns.schemas import Campaign
from app.campaigns.trials.schemas import Trial
from app.common.conflict_checks import state_label
from app.core import formatting
from app.core.definition import Interval
from app.db.models import TrialPhotoRow
from app.documents import html
from app.documents.html import Document
from app.reports.service import WORDS, Report

_TEMPLATE: Final = Path(__file__).parent / "templates" / "report.html.j2"


def render(report: Report, plotly: str) -> Document:
    """Render a report. `plotly` is the source of the chart library."""
    groups = report.statistics.groups
    content = {
        "report": report,
        "state": _state(report.campaign),
        "standing": WORDS["standings"].get(report.campaign.standing or ""),
        "baseline": next((group for group in groups if group.is_baseline), None),
        "winner": next((group for group in groups if group.is_best), None),
    }
    return html.render(_TEMPLATE, report.cards, plotly, _FILTERS, content)


def file_name(campaign_id: int, ending: str) -> str:
    """File name of a report."""
    return f"campaign-{campaign_id}-report.{ending}"


def _state(campaign: Campaign) -> str:
    if campaign.state == "finished" and campaign.outcome == "converged" and campaign.verdict is None:
        return "No better gains found"
    if campaign.state == "finished" and campaign.outcome is not None:
        return WORDS["outcomes"][campaign.outcome]
    return WORDS["states"][campaign.state]


def _interval(span: Interval | None) -> str:
    return formatting.NOTHING if span is None else formatting.interval_text(span.lower, span.upper)


def _settling_time(trial: Trial) -> str:
    """`1.34`; of a complete flight without one, that it did not settle."""
    if trial.settling_time_s is None and trial.steady_state_error_m is not None:
        return "not settled"
    return formatting.number(trial.settling_time_s, 2)


def _data_uri(photo: TrialPhotoRow) -> Markup:
    return Markup(f"data:{photo.media_type};base64,{base64.b64encode(photo.data).decode()}")  # noqa: S704  # no markup in it


_FILTERS: Final[html.Filters] = {
    "choice": lambda kind: WORDS["choices"].get(kind, kind),
    "trial_state": state_label,
    "plus_minus": formatting.measured,
    "short": formatting.short,
    "settling_time": _settling_time,
    "interval": _interval,
    "gain": formatting.gain,
    "gains": formatting.format_gains,
    "relative_to": formatting.relative_to,
    "flights": formatting.named_flights,
    "data_uri": _data_uri,
    "mebibytes": lambda size: f"{size / 2**20:g} MiB",
}
