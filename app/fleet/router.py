"""Vehicles over HTTP."""

from typing import Literal

from fastapi import APIRouter, Depends, status
from starlette.concurrency import run_in_threadpool

from app.accounts.permissions import Permission, is_allowed
from app.common.schemas import Page
from app.common.states import ActKind
from app.fleet import commands, control, registration, service, views
from app.fleet.schemas import (
    GivenGains,
    Lease,
    LeaseRequest,
    NewVehicle,
    OrderAnswer,
    Release,
    Vehicle,
    VehicleAct,
    VehicleOrder,
)
from app.live.messages import NO_LINK
from app.web.dependencies import (
    CurrentDatabase,
    Id,
    IdempotentPost,
    Live,
    Reader,
    ReadVersion,
    RequestContextDep,
    WantedPart,
    Writer,
    json_only,
)

router = APIRouter(prefix="/api/vehicles", tags=["vehicles"], dependencies=[Depends(json_only)])


@router.get("")
def list_vehicles(session: Reader, part: WantedPart) -> Page[Vehicle]:
    """Every registered vehicle, and every shared simulation that a campaign has used."""
    return service.list_vehicles(session, part)


@router.post("", status_code=status.HTTP_201_CREATED)
def register_vehicle(act: IdempotentPost, asking: RequestContextDep, body: NewVehicle) -> Vehicle:
    """Register a vehicle that Gainline keeps a link to. Whether it is REAL follows from its settings."""
    return act(lambda session: registration.register_vehicle(session, body, asking))


@router.get("/{vehicle_id}")
def get_vehicle(session: Reader, vehicle_id: Id) -> Vehicle:
    return service.get_vehicle(session, vehicle_id)


@router.delete("/{vehicle_id}", status_code=status.HTTP_204_NO_CONTENT)
def delete_vehicle(
    session: Writer,
    asking: RequestContextDep,
    vehicle_id: Id,
    version: ReadVersion,
) -> None:
    """Delete a registered vehicle that no campaign uses, with its acts, while it is disconnected."""
    registration.delete_vehicle(session, vehicle_id, version, asking)


@router.post("/{vehicle_id}/connect", status_code=status.HTTP_202_ACCEPTED)
def connect_vehicle(act: IdempotentPost, asking: RequestContextDep, vehicle_id: Id) -> VehicleAct:
    """Open the link and keep it open; the vehicle's safe gains are written and read back, unless it is armed."""
    return act(lambda session: commands.request_act(session, vehicle_id, ActKind.CONNECT, asking))


@router.post("/{vehicle_id}/disconnect", status_code=status.HTTP_202_ACCEPTED)
def disconnect_vehicle(act: IdempotentPost, asking: RequestContextDep, vehicle_id: Id) -> VehicleAct:
    """Close the link."""
    return act(lambda session: commands.request_act(session, vehicle_id, ActKind.DISCONNECT, asking))


@router.post("/{vehicle_id}/check", status_code=status.HTTP_202_ACCEPTED)
def check_vehicle(act: IdempotentPost, asking: RequestContextDep, vehicle_id: Id) -> VehicleAct:
    """Run the preflight check."""
    return act(lambda session: commands.request_act(session, vehicle_id, ActKind.CHECK, asking))


@router.post("/{vehicle_id}/restore", status_code=status.HTTP_202_ACCEPTED)
def restore_safe_gains(act: IdempotentPost, asking: RequestContextDep, vehicle_id: Id) -> VehicleAct:
    """Write the safe gains and read them back."""
    return act(lambda session: commands.request_act(session, vehicle_id, ActKind.RESTORE, asking))


@router.post("/{vehicle_id}/parameters", status_code=status.HTTP_202_ACCEPTED)
def read_parameters(act: IdempotentPost, asking: RequestContextDep, vehicle_id: Id) -> VehicleAct:
    """Read every parameter of the vehicle; they are in the act's result."""
    return act(lambda session: commands.request_act(session, vehicle_id, ActKind.PARAMETERS, asking))


@router.get("/{vehicle_id}/acts")
def list_acts(session: Reader, vehicle_id: Id, part: WantedPart) -> Page[VehicleAct]:
    """Acts of the vehicle, newest first: requests outside its flights."""
    return views.acts_view(session, vehicle_id, part)


@router.get("/{vehicle_id}/ledger")
def list_given_gains(session: Reader, vehicle_id: Id, part: WantedPart) -> Page[GivenGains]:
    """Every gain set that the vehicle was given, newest first: in flights, restored after them, and by acts."""
    return views.ledger_view(session, vehicle_id, part)


@router.post("/{vehicle_id}/land", status_code=status.HTTP_202_ACCEPTED)
async def land_vehicle(live: Live, vehicle_id: Id, body: VehicleOrder | None = None) -> OrderAnswer:
    """Land the vehicle now, whatever it is doing. Goes straight to the worker without waiting for storage."""
    return await _order(live, vehicle_id, "land", body, "Land is repeated until the vehicle descends.")


@router.post("/{vehicle_id}/motors-off", status_code=status.HTTP_202_ACCEPTED)
async def stop_motors(
    live: Live, database: CurrentDatabase, asking: RequestContextDep, vehicle_id: Id, body: VehicleOrder | None = None
) -> OrderAnswer:
    """Stop the vehicle's motors now, at any height: it falls. Goes straight to the worker without waiting for storage.
    The database is read first only for a client that may not command real vehicles, to see whether this is one."""
    if not is_allowed(Permission.STOP, asking.caller):
        await run_in_threadpool(commands.require_may_stop_motors, database, vehicle_id, asking)
    return await _order(live, vehicle_id, "motors off", body, "The command to stop the motors has been sent.")


async def _order(
    live: Live, vehicle_id: int, order: Literal["land", "motors off"], body: VehicleOrder | None, sentence: str
) -> OrderAnswer:
    reason = (body or VehicleOrder()).reason
    if not live.client.connected:
        return OrderAnswer(accepted=False, sentence=NO_LINK)
    answer = await live.client.order(vehicle_id, order, reason)
    return OrderAnswer(accepted=answer.accepted, sentence=sentence if answer.accepted else answer.problem)


@router.post("/{vehicle_id}/release")
def release_vehicle(act: IdempotentPost, asking: RequestContextDep, vehicle_id: Id, body: Release) -> Vehicle:
    """Release a vehicle from quarantine, on the statement of a person who has inspected it. A vehicle with a link is
    released once the worker has verified that it is disarmed and holds its safe gains; the act reports the outcome."""
    return act(lambda session: commands.release_vehicle(session, vehicle_id, body.statement, asking))


@router.put("/{vehicle_id}/control")
def take_control(session: Writer, asking: RequestContextDep, vehicle_id: Id, body: LeaseRequest) -> Lease:
    """Take control for 15 s, or renew the lease with its token; taking over from another operator is recorded as an
    act."""
    return control.take_control(session, vehicle_id, body, asking)


@router.delete("/{vehicle_id}/control", status_code=status.HTTP_204_NO_CONTENT)
def give_up_control(session: Writer, asking: RequestContextDep, vehicle_id: Id) -> None:
    """Give up control: no operator is in control afterwards."""
    control.give_up_control(session, vehicle_id, asking.token)
