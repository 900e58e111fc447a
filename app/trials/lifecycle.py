"""The moves of trials and flights, by their tables and by nothing else."""

from collections.abc import Iterable

from app.db.models import FlightRow, TrialRow
from app.db.types import utc_now
from app.moves import check_transition
from app.trials.states import ACTIVE_STATES, FLIGHT_TRANSITIONS, TRANSITIONS, UNFLOWN, FlightState, TrialState


def set_trial_state(row: TrialRow, to: TrialState, *, reason: str | None = None) -> None:
    """Raises ConflictError when the states' table does not lead there. A reason replaces the one before."""
    row.state = check_transition(TRANSITIONS, row.state, to, f"Trial {row.number}")
    if reason is not None:
        row.reason = reason


def set_flight_state(row: FlightRow, to: FlightState, *, problem: str = "") -> None:
    """Raises ConflictError when the states' table does not lead there."""
    row.state = check_transition(FLIGHT_TRANSITIONS, row.state, to, f"Flight {row.id}")
    row.problem = problem
    if to not in ACTIVE_STATES:
        row.finished_at = utc_now()


def cancel_unflown(trials: Iterable[TrialRow], flight: FlightRow | None, reason: str) -> None:
    """Give up whatever has not flown, with `flight`, where it belongs to one of them and no worker has begun it.

    A worker that has begun it finds its trial cancelled before the lift-off, and stands down.
    """
    for row in trials:
        if row.state in UNFLOWN:
            set_trial_state(row, TrialState.CANCELLED, reason=reason)
            if flight is not None and flight.trial_id == row.id and flight.state == FlightState.REQUESTED:
                set_flight_state(flight, FlightState.CANCELLED, problem=reason)
