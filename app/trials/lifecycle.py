"""The moves of trials and flights, by their tables and by nothing else."""

from collections.abc import Iterable

from app.db.models import FlightRow, TrialRow
from app.db.types import utc_now
from app.moves import check_move
from app.trials.states import FLIGHT_MOVES, MOVES, UNDER_WAY, UNFLOWN, FlightState, TrialState


def move_trial(row: TrialRow, to: TrialState, *, reason: str | None = None) -> None:
    """Raises ConflictError when the states' table does not lead there. A reason replaces the one before."""
    row.state = check_move(MOVES, row.state, to, f"Trial {row.number}")
    if reason is not None:
        row.reason = reason


def move_flight(row: FlightRow, to: FlightState, *, problem: str = "") -> None:
    """Raises ConflictError when the states' table does not lead there."""
    row.state = check_move(FLIGHT_MOVES, row.state, to, f"Flight {row.id}")
    row.problem = problem
    if to not in UNDER_WAY:
        row.finished_at = utc_now()


def cancel_unflown(trials: Iterable[TrialRow], flight: FlightRow | None, reason: str) -> None:
    """Give up whatever has not flown, with `flight`, where it belongs to one of them and no worker has begun it.

    A worker that has begun it finds its trial cancelled before the lift-off, and stands down.
    """
    for row in trials:
        if row.state in UNFLOWN:
            move_trial(row, TrialState.CANCELLED, reason=reason)
            if flight is not None and flight.trial_id == row.id and flight.state == FlightState.REQUESTED:
                move_flight(flight, FlightState.CANCELLED, problem=reason)
