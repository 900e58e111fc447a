"""HTTP API of flight comparisons."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.compare import service
from app.compare.schemas import FlightComparison
from app.figures.base import Card
from app.web.dependencies import Reader, Theme, described

router = APIRouter(prefix="/api/compare", tags=["compare"])

TrialIds = Annotated[
    list[Annotated[int, Query(ge=1, le=2**63 - 1)]],
    Query(alias="trial", min_length=2, max_length=20, description="2 to 20 flights; the first is the reference"),
]


@router.get("")
def compare_flights(session: Reader, trial: TrialIds) -> FlightComparison:
    """Compare flights of any campaigns, in the order given.

    Returns their gains, settings and errors, what differs, and which of each two is better.
    """
    return service.compare_flights(session, trial)


@router.get("/figure")
def get_comparison_figure(session: Reader, trial: TrialIds, theme: Theme = "light") -> Card:
    """Their curves over the set point, and below them the difference of each from the first."""
    return service.comparison_figure(session, trial, theme)


@router.get("/curves.csv", response_class=Response, responses=described("text/csv", binary=False))
def get_comparison_csv(session: Reader, trial: TrialIds) -> Response:
    """Their curves on a common time grid of 0.02 s; each flight's own CSV contains the record as stored."""
    name, csv = service.export_curves(session, trial)
    return Response(csv, media_type="text/csv", headers={"Content-Disposition": f'attachment; filename="{name}"'})
