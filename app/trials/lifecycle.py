"""The moves of trials and flights, by their tables and by nothing else."""

from collections.abc import Iterable

from app.db.models import FlightRow, TrialRow
from app.db.types import utc_now
from app.moves import check_move
from app.trials.states import FLIGHT_MOVES, MOVES, UNDER_WAY, FlightState, TrialState


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


def cancel_planned(trials: Iterable[TrialRow], reason: str) -> None:
    """Give up whatever is only planned."""
    for row in trials:
        if row.state == TrialState.PLANNED:
            move_trial(row, TrialState.CANCELLED, reason=reason)
