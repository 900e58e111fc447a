"""Vehicles over HTTP."""

from fastapi import APIRouter, Depends

from app.api.deps import Act, CursorText, Id, Limit, Reader, json_only
from app.fleet import service
from app.fleet.schemas import GivenGains, Release, Vehicle
from app.schemas import Page

router = APIRouter(prefix="/api/vehicles", tags=["vehicles"], dependencies=[Depends(json_only)])


@router.get("")
def list_vehicles(session: Reader, limit: Limit = 50, cursor: CursorText = None) -> Page[Vehicle]:
    """Every vehicle that a campaign has used."""
    return service.list_vehicles(session, limit=limit, cursor=cursor)


@router.get("/{vehicle_id}")
def get_vehicle(session: Reader, vehicle_id: Id) -> Vehicle:
    return service.get_vehicle(session, vehicle_id)


@router.get("/{vehicle_id}/ledger")
def list_given_gains(session: Reader, vehicle_id: Id, limit: Limit = 50, cursor: CursorText = None) -> Page[GivenGains]:
    """Every gain set that the vehicle was given, the newest first."""
    return service.list_given_gains(session, vehicle_id, limit=limit, cursor=cursor)


@router.post("/{vehicle_id}/release")
def release_vehicle(act: Act, vehicle_id: Id, body: Release) -> Vehicle:
    """Take a vehicle out of quarantine, on the word of a person who has looked at it."""
    return act(Vehicle, lambda session: service.release_vehicle(session, vehicle_id, body.statement))
