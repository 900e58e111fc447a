"""What has been measured so far of each flight in the air, for the streams that join late. One event loop only."""

from dataclasses import replace

from app.live.messages import FlightPhase, Telemetry

_OVER = frozenset({"landed", "ended"})


class FlightMemory:
    """Grows with the telemetry of a flight and forgets it when the flight is over."""

    def __init__(self) -> None:
        self._flights: dict[int, Telemetry] = {}

    def take(self, message: Telemetry | FlightPhase) -> None:
        if isinstance(message, FlightPhase):
            if message.phase in _OVER:
                self._flights.pop(message.trial_id, None)
            return
        before = self._flights.get(message.trial_id)
        if before is None:
            self._flights[message.trial_id] = replace(message, samples=list(message.samples))
            return
        before.samples.extend(message.samples)
        self._flights[message.trial_id] = replace(message, samples=before.samples)

    def forget_all(self) -> None:
        """The worker is gone, and with it whatever flew."""
        self._flights.clear()

    def so_far(self) -> list[Telemetry]:
        """One message for each flight, with everything measured since its command."""
        return [replace(flight, samples=list(flight.samples)) for flight in self._flights.values()]
