"""State changes of trials and flights; only those in the transition tables are possible."""

from collections.abc import Iterable

from app.common.state_machine import check_transition
from app.common.states import (
    ACTIVE_FLIGHT_STATES,
    FLIGHT_TRANSITIONS,
    TRIAL_TRANSITIONS,
    UNFLOWN_TRIAL_STATES,
    FlightState,
    TrialState,
)
from app.db.models import FlightRow, TrialRow
from app.db.types import utc_now


def set_trial_state(row: TrialRow, to: TrialState, *, reason: str | None = None) -> None:
    """Change a trial's state; a given reason replaces the previous one.

    Raises ConflictError when the transition is not in the table.
    """
    row.state = check_transition(TRIAL_TRANSITIONS, row.state, to, f"Trial {row.number}")
    if reason is not None:
        row.reason = reason


def set_flight_state(row: FlightRow, to: FlightState, *, problem: str = "") -> None:
    """Change a flight's state. Raises ConflictError when the transition is not in the table."""
    row.state = check_transition(FLIGHT_TRANSITIONS, row.state, to, f"Flight {row.id}")
    row.problem = problem
    if to not in ACTIVE_FLIGHT_STATES:
        row.finished_at = utc_now()


def cancel_unflown(trials: Iterable[TrialRow], flight: FlightRow | None, reason: str) -> None:
    """Cancel all trials that have not flown, and `flight` if it belongs to one of them and is not claimed yet.

    A worker that has claimed the flight finds its trial cancelled before lift-off and stands down.
    """
    for row in trials:
        if row.state in UNFLOWN_TRIAL_STATES:
            set_trial_state(row, TrialState.CANCELLED, reason=reason)
            if flight is not None and flight.trial_id == row.id and flight.state == FlightState.REQUESTED:
                set_flight_state(flight, FlightState.CANCELLED, problem=reason)
