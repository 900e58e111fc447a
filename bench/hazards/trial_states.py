"""States of a trial, derived from the packets and the drone's true height, not from the program's own state."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from app.core.experiments.takeoff import WINDOW_S
from bench.hazards.wire import Command

LIFTED_M: Final = 0.15
RESTING_M: Final = 0.002
"""Greatest height of a vehicle that stands on the ground: above it, it is lifting off or touching down."""
_BEYOND_S: Final = 0.2
_SILENT_S: Final = 0.9


class State(StrEnum):
    """State of a trial, from the opening of the link to the read-back of the safe gains."""

    CONNECT = "connect"
    PREFLIGHT = "preflight"
    SET_GAINS = "set gains"
    ARM = "arm"
    TAKEOFF = "take-off"
    RECORD = "record"
    LAND = "land"
    ABORT_LAND = "abort-land"
    LINK_LOST = "link lost"
    DISARM = "disarm"
    RESTORE = "restore"


AIR: Final = (State.TAKEOFF, State.RECORD)
DESCENT: Final = (State.LAND, State.ABORT_LAND, State.LINK_LOST)
_BEFORE_ARMING: Final = (State.CONNECT, State.PREFLIGHT, State.SET_GAINS)
_FLOWN: Final = (*AIR, *DESCENT)


@dataclass(slots=True)
class TrialStates:
    """Timeline of a trial: the states that it has entered and the commands sent, in the drone's time."""

    entered: list[tuple[State, float]] = field(default_factory=list)
    commands: list[tuple[float, Command]] = field(default_factory=list)
    ended_s: float = float("inf")
    window_s: float = WINDOW_S

    @property
    def now(self) -> State | None:
        return self.entered[-1][0] if self.entered else None

    def begin(self, now_s: float) -> None:
        """Begin the timeline: the program opens the link."""
        self._enter(State.CONNECT, now_s)

    @property
    def recorded_s(self) -> float:
        """Time from the takeoff command to the end of the record, less what it may be early."""
        return self.window_s + _BEYOND_S

    def first_s(self, state: State) -> float | None:
        return next((since_s for each, since_s in self.entered if each is state), None)

    def spans(self, *states: State) -> list[tuple[float, float]]:
        """Return the spans in which the trial was in one of these states."""
        ends = [since_s for _, since_s in self.entered[1:]] + [self.ended_s]
        return [(since_s, end_s) for (each, since_s), end_s in zip(self.entered, ends, strict=True) if each in states]

    def at(self, now_s: float) -> State | None:
        """Return the state at a time."""
        return next((each for each, since_s in reversed(self.entered) if since_s <= now_s), None)

    def times_of(self, command: Command) -> list[float]:
        return [at_s for at_s, each in self.commands if each is command]

    def update_height(self, height_m: float, now_s: float) -> None:
        if self.now is State.TAKEOFF and height_m > LIFTED_M:
            self._enter(State.RECORD, now_s)

    def receive(
        self, command: Command, now_s: float, *, armed: bool, height_m: float, silent_since_s: float | None
    ) -> None:
        """Update the state after a command reached the drone's antenna.

        `silent_since_s` is when the program received the last heartbeat, None while heartbeats arrive.
        """
        self.commands.append((now_s, command))
        following = self._following(command, now_s, armed=armed, height_m=height_m, silent_since_s=silent_since_s)
        if following is not None and following is not self.now:
            self._enter(following, now_s)

    def _enter(self, state: State, now_s: float) -> None:
        self.entered.append((state, now_s))

    def _following(  # noqa: PLR0911 - one return for each transition
        self, command: Command, now_s: float, *, armed: bool, height_m: float, silent_since_s: float | None
    ) -> State | None:
        now, flown = self.now, self.now in _FLOWN
        match command:
            case Command.REQUEST if now is State.CONNECT:
                return State.PREFLIGHT
            case Command.GAIN if now in _BEFORE_ARMING:
                return State.SET_GAINS
            case Command.GAIN if now is State.ARM or (now in (*DESCENT, State.DISARM) and not armed):
                return State.RESTORE
            case Command.GAIN if flown or (now is State.DISARM and height_m > LIFTED_M):
                return State.ABORT_LAND
            case Command.PREPARE_ARMING | Command.SET_POINT | Command.ARM if now in (State.PREFLIGHT, State.SET_GAINS):
                return State.ARM
            case Command.TAKE_OFF if now is State.ARM:
                return State.TAKEOFF
            case Command.LAND if flown or now is State.DISARM:
                return self._landing(now_s, silent_since_s)
            case Command.MOTORS_OFF if now is not State.RESTORE:
                return State.DISARM
            case _:
                return None

    def _landing(self, now_s: float, silent_since_s: float | None) -> State | None:
        if (
            silent_since_s is not None
            and now_s - silent_since_s > _SILENT_S
            and self.now not in (State.LAND, State.ABORT_LAND)
        ):
            return State.LINK_LOST
        commanded_s = self.first_s(State.TAKEOFF)
        if self.now in AIR:
            full = commanded_s is not None and now_s - commanded_s > self.recorded_s
            return State.LAND if full else State.ABORT_LAND
        return State.ABORT_LAND if self.now in (State.LINK_LOST, State.DISARM) else None
