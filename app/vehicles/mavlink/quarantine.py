"""State of a vehicle between flights, and its quarantine: what may still be done with a vehicle in doubt."""

from typing import Final

from app.vehicles.base import SafeGainsError
from app.vehicles.mavlink.trial_state import QUARANTINE_STATES, TRANSITIONS, State

_ON_THE_GROUND: Final = frozenset({State.CONNECT, State.PREFLIGHT, State.SET_GAINS})


class Quarantine:
    """State of a vehicle, `why` it may only be observed, and what a person has `requested` meanwhile."""

    def __init__(self) -> None:
        self.state = State.CONNECT
        self.why = self.requested = ""

    @property
    def is_active(self) -> bool:
        """Whether only Land and motors off may be sent, until a person releases the vehicle."""
        return self.state in QUARANTINE_STATES

    @property
    def concern(self) -> str:
        """Reason why the vehicle may only be observed; empty if it may fly."""
        return " ".join(part for part in (self.why, self.requested) if part) if self.is_active else ""

    def reported_step(self, state: State, *, is_flying: bool) -> str:
        """The step of a trial: what comes before arming is one step, and none without a trial."""
        if state not in _ON_THE_GROUND:
            return state.value
        return (State.PREFLIGHT if is_flying else State.IDLE).value

    def enter(self, state: State) -> None:
        if state not in TRANSITIONS[self.state]:
            raise AssertionError(f"A vehicle cannot go from {self.state} to {state}.")
        self.state = state

    def begin(self, state: State, why: str) -> None:
        """Begin to observe, or quarantine; a vehicle that is already in quarantine stays in its state."""
        if not self.is_active:
            self.enter(state)
        self.why = why

    def add(self, change: str) -> None:
        """Add a further reason."""
        if change not in self.why:
            self.why = f"{self.why} {change}".strip()

    def end(self) -> None:
        if self.is_active:
            self.enter(State.IDLE)
        self.why = ""

    def require_none(self) -> None:
        """Raise SafeGainsError while the vehicle may only be observed."""
        if self.state is State.QUARANTINE:
            raise SafeGainsError(
                f"{self.why} Nothing is written to a vehicle that may be in the air.",
                hint="Land it if it is flying, check that its motors have stopped, verify its gains, then release it.",
            )
        if self.state is State.OBSERVE:
            raise SafeGainsError(
                f"The vehicle is only observed. {self.concern}",
                hint="Check that it is on the ground with its motors stopped, then release it.",
            )
