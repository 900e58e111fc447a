"""The figures of a campaign, one file each: plain data in, a Plotly figure and a data table out.

A new figure takes one file and one line in `CAMPAIGN_FIGURES`, with its `FigureName`.
"""

from collections.abc import Mapping
from typing import Final, Literal

from app.figures.base import CampaignFigure
from app.figures.error_history import ErrorsFigure
from app.figures.gains import GainsFigure
from app.figures.takeoffs import TrajectoriesFigure

FigureName = Literal["takeoffs", "errors", "gains"]
CAMPAIGN_FIGURES: Final[Mapping[str, type[CampaignFigure]]] = {
    "takeoffs": TrajectoriesFigure,
    "errors": ErrorsFigure,
    "gains": GainsFigure,
}
