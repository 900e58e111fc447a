"""Figures over HTTP: Plotly JSON that a browser draws, with the same data as a table."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from app.api.deps import Id, Reader
from app.campaigns import drawing
from app.figures.base import Card
from app.figures.theme import ThemeName

router = APIRouter(prefix="/api", tags=["figures"])

FigureName = Literal["takeoffs", "errors", "gains"]
Theme = Annotated[ThemeName, Query(description="colours for a light or a dark page")]


class FigureColumn(BaseModel):
    """One column of a figure's table; `digits` after the point, null for text."""

    name: str
    title: str
    unit: str
    digits: int | None


class FigureTable(BaseModel):
    """The figure's data in numbers."""

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
def get_campaign_figure(session: Reader, campaign_id: Id, name: FigureName, theme: Theme = "light") -> FigureCard:
    """All takeoffs over the set point, the error of each flight, or the gains of each flight."""
    return figure_card(drawing.campaign_figure(session, campaign_id, name, theme))


@router.get("/trials/{trial_id}/figure")
def get_flight_figure(session: Reader, trial_id: Id, theme: Theme = "light") -> FigureCard:
    """One flight by itself, with its prediction and its commands."""
    return figure_card(drawing.flight_figure(session, trial_id, theme))


def figure_card(card: Card) -> FigureCard:
    """The card as it is answered."""
    return FigureCard.model_validate(card, from_attributes=True)
