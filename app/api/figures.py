"""Figures over HTTP: Plotly JSON for the browser, with the same data as a table."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from app.api.deps import Id, Reader
from app.campaigns import drawing
from app.common.errors import InputError, Problem
from app.figures.base import Card
from app.figures.history import Range
from app.figures.theme import ThemeName

router = APIRouter(prefix="/api", tags=["figures"])

FigureName = Literal["takeoffs", "errors", "gains"]
Theme = Annotated[ThemeName, Query(description="colours for a light or a dark page")]


class FigureColumn(BaseModel):
    """One column of a figure's table; `digits` after the decimal point, null for text."""

    name: str
    title: str
    unit: str
    digits: int | None


class FigureTable(BaseModel):
    """The figure's data as a table."""

    columns: list[FigureColumn]
    rows: list[list[str | int | float | None]]


class FigureCard(BaseModel):
    """A figure, or why there is none: `waiting` for data, or `failed`. `summary` says in a sentence what it shows."""

    name: str
    title: str
    state: Literal["ready", "waiting", "failed"]
    summary: str
    reason: str
    figure: Annotated[dict[str, object] | None, Field(description="Plotly's own JSON: data and layout")]
    table: FigureTable | None


@router.get("/campaigns/{campaign_id}/figures/{name}")
def get_campaign_figure(
    session: Reader,
    campaign_id: Id,
    name: FigureName,
    theme: Theme = "light",
    from_s: Annotated[float | None, Query(description="first second of the curves that is looked at")] = None,
    to_s: Annotated[float | None, Query(description="last second of the curves that is looked at")] = None,
    flight: Annotated[
        int | None, Query(ge=1, le=2**31, description="number of a flight that is to have a curve of its own")
    ] = None,
) -> FigureCard:
    """All takeoffs over the set point, the error of each flight, or the gains of each flight.

    With more than 30 flights the takeoffs are drawn as an envelope; the first, the best, the latest and that `flight`
    are drawn individually. Between `from_s` and `to_s` the curves are drawn with more points.
    """
    view = drawing.FigureView(window=_window(from_s, to_s), chosen=flight)
    return figure_card(drawing.campaign_figure(session, campaign_id, name, theme, view))


def _window(from_s: float | None, to_s: float | None) -> Range | None:
    """Time range of the curves. Raises InputError when it ends before it begins, or has one end only."""
    if from_s is None and to_s is None:
        return None
    if from_s is None or to_s is None or not from_s < to_s:
        raise InputError(
            "These seconds cannot be drawn.",
            problems=(Problem("to_s", "must be given together with from_s, and be later"),),
            hint="Give both ends in seconds since the command, or none for the whole flight.",
        )
    return Range(from_s, to_s)


@router.get("/trials/{trial_id}/figure")
def get_flight_figure(session: Reader, trial_id: Id, theme: Theme = "light") -> FigureCard:
    """One flight, with its prediction and its commands."""
    return figure_card(drawing.flight_figure(session, trial_id, theme))


def figure_card(card: Card) -> FigureCard:
    """Convert a card to its API schema."""
    return FigureCard.model_validate(card, from_attributes=True)
