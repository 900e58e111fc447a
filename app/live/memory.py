"""Present state for streams that join late: telemetry so far of each running flight, and the vehicles' status.

For one event loop only.
"""

import time
from collections.abc import Callable
from dataclasses import replace

from app.live.messages import FlightPhase, PublishedMessage, Telemetry, VehicleLinkState, VehicleStatus

_OVER = frozenset({"landed", "ended"})


class LiveState:
    """Accumulates the telemetry of each flight until it is over, and keeps each vehicle's newest status.

    `clock_s` gives the age of a message when it is sent again: from a worker that hangs, no newer one comes.
    """

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._flights: dict[int, tuple[Telemetry, float]] = {}
        self._vehicles: dict[int, tuple[VehicleStatus, float]] = {}

    def take(self, message: PublishedMessage) -> None:
        match message:
            case VehicleStatus():
                self._vehicles[message.vehicle_id] = message, self._clock_s()
            case FlightPhase():
                if message.phase in _OVER:
                    self._flights.pop(message.trial_id, None)
            case Telemetry():
                self._flights[message.trial_id] = self._grown(message), self._clock_s()

    def forget_all(self) -> None:
        """Forget everything, after the loss of the worker."""
        self._flights.clear()
        self._vehicles.clear()

    def snapshot(self) -> list[PublishedMessage]:
        """One message for each vehicle, and one for each flight with its telemetry since the command, each with its
        age."""
        now_s = self._clock_s()
        vehicles = (replace(status, age_s=now_s - heard_s) for status, heard_s in self._vehicles.values())
        flights = (
            replace(flight, samples=list(flight.samples), age_s=now_s - heard_s)
            for flight, heard_s in self._flights.values()
        )
        return [*vehicles, *flights]

    def vehicles(self, state: VehicleLinkState) -> list[VehicleStatus]:
        """The newest status of each vehicle whose link is in that state."""
        return [status for status, _ in self._vehicles.values() if status.state == state]

    def _grown(self, message: Telemetry) -> Telemetry:
        """The message with all earlier samples of the flight."""
        if message.trial_id not in self._flights:
            return replace(message, samples=list(message.samples))
        before, _ = self._flights[message.trial_id]
        before.samples.extend(message.samples)
        return replace(message, samples=before.samples)
