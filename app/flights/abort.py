"""Requests to abort a flight, in memory so that nothing blocks."""

from collections.abc import Callable
from typing import Final

PROGRAM_STOPPED: Final = "Gainline was stopped"
"""Reason of the aborts when the worker is stopped: its cause is neither the vehicle nor its operator."""


class AbortFlag:
    """Request to end one flight. Set once, from any thread; the listener is notified at once."""

    def __init__(self) -> None:
        self.reason: str | None = None
        self._tell: Callable[[str], None] = lambda _reason: None

    def set(self, reason: str) -> None:
        """Set the flag; only the first reason counts."""
        if self.reason is None:
            self.reason = reason or "aborted"
            self._tell(self.reason)

    def add_listener(self, tell: Callable[[str], None]) -> None:
        """Set the listener; it is called at once if the flag is set already."""
        self._tell = tell
        if self.reason is not None:
            tell(self.reason)


class AbortRegistry:
    """Abort flags of the flights of this process, by trial. Lock-free: safe from any thread and from signal
    handlers."""

    def __init__(self) -> None:
        self._flags: dict[int, AbortFlag] = {}
        self._closed: str | None = None

    def register(self, trial_id: int) -> AbortFlag:
        """Return the trial's flag; in a closed registry it is set already."""
        flag = self._flags.setdefault(trial_id, AbortFlag())
        if self._closed is not None:
            flag.set(self._closed)
        return flag

    def unregister(self, trial_id: int) -> None:
        self._flags.pop(trial_id, None)

    def abort(self, trial_id: int, reason: str) -> bool:
        """Abort the trial's flight. Returns whether that trial is being flown here."""
        if (flag := self._flags.get(trial_id)) is None:
            return False
        flag.set(reason)
        return True

    def abort_all(self, reason: str) -> None:
        """End every flight, and every flight registered later."""
        self._closed = reason
        for flag in tuple(self._flags.values()):
            flag.set(reason)

    def trial_ids(self) -> list[int]:
        return sorted(self._flags)
