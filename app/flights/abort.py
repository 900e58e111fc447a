"""Requests to abort a flight, in memory so that nothing blocks."""

from collections.abc import Callable

from app.vehicles.flight_end import StopRequest


class AbortFlag:
    """Request to end one flight. Set once, from any thread; the listener is notified at once."""

    def __init__(self) -> None:
        self.request: StopRequest | None = None
        self._tell: Callable[[StopRequest], None] = lambda _request: None

    def set(self, request: StopRequest) -> None:
        """Set the flag; only the first request counts."""
        if self.request is None:
            self.request = request
            self._tell(request)

    def add_listener(self, tell: Callable[[StopRequest], None]) -> None:
        """Set the listener; it is called at once if the flag is set already."""
        self._tell = tell
        if self.request is not None:
            tell(self.request)


class AbortRegistry:
    """Abort flags of the flights of this process, by trial. Lock-free: safe from any thread and from signal
    handlers."""

    def __init__(self) -> None:
        self._flags: dict[int, AbortFlag] = {}
        self._closed: StopRequest | None = None

    def register(self, trial_id: int) -> AbortFlag:
        """Return the trial's flag; in a closed registry it is set already."""
        flag = self._flags.setdefault(trial_id, AbortFlag())
        if self._closed is not None:
            flag.set(self._closed)
        return flag

    def unregister(self, trial_id: int) -> None:
        self._flags.pop(trial_id, None)

    def abort(self, trial_id: int, request: StopRequest) -> bool:
        """Abort the trial's flight. Returns whether that trial is being flown here."""
        if (flag := self._flags.get(trial_id)) is None:
            return False
        flag.set(request)
        return True

    def abort_all(self, request: StopRequest) -> None:
        """End every flight, and every flight registered later."""
        self._closed = request
        for flag in tuple(self._flags.values()):
            flag.set(request)

    def trial_ids(self) -> list[int]:
        return sorted(self._flags)
