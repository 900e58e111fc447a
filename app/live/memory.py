"""What streams that join late are told first: what has been measured so far of each flight in the air, and how the
vehicles are. One event loop only."""

from dataclasses import replace

from app.live.messages import FlightPhase, Shown, Telemetry, VehicleStatus

_OVER = frozenset({"landed", "ended"})


class Memory:
    """Grows with the telemetry of a flight and forgets it when the flight is over; of a vehicle's status it keeps the
    newest."""

    def __init__(self) -> None:
        self._flights: dict[int, Telemetry] = {}
        self._vehicles: dict[int, VehicleStatus] = {}

    def take(self, message: Shown) -> None:
        match message:
            case VehicleStatus():
                self._vehicles[message.vehicle_id] = message
            case FlightPhase():
                if message.phase in _OVER:
                    self._flights.pop(message.trial_id, None)
            case Telemetry():
                self._grow(message)

    def forget_all(self) -> None:
        """The worker is gone, and with it whatever flew or was connected."""
        self._flights.clear()
        self._vehicles.clear()

    def so_far(self) -> list[Shown]:
        """One message for each vehicle, and one for each flight with everything measured since its command."""
        flights = (replace(flight, samples=list(flight.samples)) for flight in self._flights.values())
        return [*self._vehicles.values(), *flights]

    def _grow(self, message: Telemetry) -> None:
        before = self._flights.get(message.trial_id)
        if before is None:
            self._flights[message.trial_id] = replace(message, samples=list(message.samples))
            return
        before.samples.extend(message.samples)
        self._flights[message.trial_id] = replace(message, samples=before.samples)
