"""API views of what was asked of a vehicle: its acts, and its gain history."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from sqlalchemy import Row
from sqlalchemy.orm import Session

from app.common.schemas import Page
from app.common.states import (
    ACTIVE_ACT_STATES,
    ACTIVE_FLIGHT_STATES,
    FLIGHT_COMMANDS,
    FLOWN_FLIGHT_STATES,
    ActKind,
    ActState,
    FlightState,
    TrialState,
)
from app.db.models import FlightRow, VehicleActRow, VehicleRow
from app.db.pages import Order, Part, page_of
from app.fleet import repository
from app.fleet.schemas import GivenGains, VehicleAct
from app.vehicles.flight_end import end_text


def _act_view(row: VehicleActRow, flight: FlightRow | None) -> VehicleAct:
    """The act; with the flight that it is a command of, its outcome follows from that of the flight."""
    state, problem = (row.state, row.problem) if flight is None else _command_outcome(row.kind, flight)
    finished_at = None if state in ACTIVE_ACT_STATES else row.finished_at
    return VehicleAct.view_of(row, state=state, problem=problem, finished_at=finished_at)


def _command_outcome(kind: ActKind, flight: FlightRow) -> tuple[ActState, str]:
    """State of a command of a flight, and why it failed."""
    is_over = flight.state not in ACTIVE_FLIGHT_STATES
    is_done = {
        ActKind.STAGE: flight.read_back == flight.gains,
        ActKind.TAKE_OFF: flight.state in FLOWN_FLIGHT_STATES
        or (not is_over and flight.trial.state == TrialState.FLYING),
        ActKind.UNSTAGE: is_over and flight.restored is not None,
        ActKind.ABORT: is_over and flight.state not in {FlightState.LANDED, FlightState.LOST},
    }[kind]
    if is_done:
        return ActState.DONE, ""
    if is_over:
        return ActState.FAILED, end_text(flight.end) or "The flight had ended before."
    return ActState.REQUESTED if flight.state == FlightState.REQUESTED else ActState.RUNNING, ""


def acts_view(session: Session, vehicle_id: int, part: Part) -> Page[VehicleAct]:
    """Page of acts, newest first. Raises NotFoundError."""
    repository.get_one(session, vehicle_id)
    newest_first = Order("-id", VehicleActRow.id.expression, descending=True)
    return page_of(session, repository.acts_of(vehicle_id), newest_first, part, partial(_act_views, session))


def _act_views(session: Session, rows: Sequence[VehicleActRow]) -> list[VehicleAct]:
    of_flights = {row.id: row.result["flight_id"] for row in rows if row.result and row.kind in FLIGHT_COMMANDS}
    flights = repository.rows_by_id(session, FlightRow, of_flights.values())
    return [_act_view(row, flights.get(of_flights.get(row.id, 0))) for row in rows]


def ledger_view(session: Session, vehicle_id: int, part: Part) -> Page[GivenGains]:
    """Page of the gain sets that the vehicle was given, newest first. Raises NotFoundError."""
    vehicle = repository.get_one(session, vehicle_id)
    wanted, order = repository.ledger(vehicle_id)
    return page_of(session, wanted, order, part, partial(_ledger_lines, session, vehicle))


def _ledger_lines(session: Session, vehicle: VehicleRow, lines: Sequence[Row[Any]]) -> list[GivenGains]:
    of_flights = {"flight", repository.RESTORE_AFTER_FLIGHT}
    flights = repository.rows_by_id(session, FlightRow, [line.id // 2 for line in lines if line.kind in of_flights])
    acts = repository.rows_by_id(
        session, VehicleActRow, [line.id // 2 for line in lines if line.kind not in of_flights]
    )
    return [
        _of_flight(flights[line.id // 2])
        if line.kind == "flight"
        else _of_restoring(vehicle, flights[line.id // 2])
        if line.kind == repository.RESTORE_AFTER_FLIGHT
        else _of_act(acts[line.id // 2])
        for line in lines
    ]


def _of_flight(row: FlightRow) -> GivenGains:
    return GivenGains.view_of(
        row,
        purpose="flight",
        flight_id=row.id,
        act_id=None,
        asked=row.gains,
        outcome="record invalid" if row.state == FlightState.LANDED and row.trial.ending == "invalid" else row.state,
        asked_at=row.claimed_at,
    )


def _of_restoring(vehicle: VehicleRow, row: FlightRow) -> GivenGains:
    asked = row.safe_gains if row.safe_gains is not None else vehicle.safe_gains
    return GivenGains.view_of(
        row,
        purpose=repository.RESTORE_AFTER_FLIGHT,
        flight_id=row.id,
        act_id=None,
        asked=asked,
        read_back=row.restored,
        outcome="not confirmed" if row.restored is None else "done" if row.restored == asked else "failed",
        asked_at=row.restored_at or row.finished_at,
    )


def _of_act(row: VehicleActRow) -> GivenGains:
    return GivenGains.view_of(
        row,
        purpose=row.kind.value,
        flight_id=None,
        campaign_id=None,
        trial_id=None,
        act_id=row.id,
        asked=row.asked or {},
        outcome=row.state.value,
        asked_at=row.claimed_at,
    )
