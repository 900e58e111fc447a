"""The figures of a campaign, one file each: plain data in, a Plotly figure and a data table out.

A new figure takes one file and one line in `CAMPAIGN_FIGURES`.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from app.figures.base import Figure
from app.figures.data import History
from app.figures.error_history import ErrorsFigure
from app.figures.gains import GainsFigure
from app.figures.takeoffs import TrajectoriesFigure
from app.figures.theme import ThemeName

CAMPAIGN_FIGURES: Final[Mapping[str, Callable[[History, ThemeName], Figure]]] = MappingProxyType(
    {
        "takeoffs": TrajectoriesFigure,
        "errors": ErrorsFigure,
        "gains": GainsFigure,
    }
)
