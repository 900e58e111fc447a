"""Condition of a vehicle over HTTP, from its flights: calibration and batteries."""

from typing import Literal

from fastapi import APIRouter

from app.api.deps import Id, Reader
from app.api.figures import FigureCard, Theme, figure_card
from app.campaigns import wear
from app.campaigns.wear import VehicleCalibration

router = APIRouter(prefix="/api/vehicles", tags=["vehicles"])


@router.get("/{vehicle_id}/calibration")
def get_calibration(session: Reader, vehicle_id: Id) -> VehicleCalibration:
    """The model as fitted after each flight, over all campaigns of the vehicle, and whether it should be tuned
    again."""
    return wear.calibration_of(session, vehicle_id)


@router.get("/{vehicle_id}/figures/{name}")
def get_vehicle_figure(
    session: Reader, vehicle_id: Id, name: Literal["calibration", "batteries"], theme: Theme = "light"
) -> FigureCard:
    """The fitted parameters over the vehicle's flights, or the battery voltages before and after each flight."""
    return figure_card(wear.vehicle_figure(session, vehicle_id, name, theme))
