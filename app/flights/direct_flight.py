"""Flights in the process of their runner, without a worker: those of `gainline run`."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from app.core.clock import REAL_TIME
from app.flights.flight_loop import FlightExecution
from app.flights.process_messages import CancelFlight, FlightRequest, TakeOffDecision, ToVehicleProcess
from app.live.messages import Telemetry
from app.vehicles.base import SafeGainsError, Vehicle
from app.vehicles.flight_end import StopRequest
from app.vehicles.registry import open_vehicle


class DirectFlight(FlightExecution):
    """What a runner without processes flies with, on its own thread.

    `show` gets the telemetry; `hold` hears the gains on the vehicle, None while they are unknown. `trial_parameters` is
    as in `open_vehicle`. `error` is what ended the last flight, if anything did.
    """

    alive = True
    staging_lost = ""

    def __init__(
        self,
        show: Callable[[Telemetry], None],
        hold: Callable[[Mapping[str, float] | None], None],
        trial_parameters: Path | None,
    ) -> None:
        super().__init__(REAL_TIME, show)
        self._hold = hold
        self._trial_parameters = trial_parameters
        self._answer = TakeOffDecision(None)
        self.error: Exception | None = None

    def decide(self, takes_off: bool) -> None:
        self._answer = TakeOffDecision(math.inf if takes_off else None)

    def cancel_flight(self, trial_id: int, request: StopRequest) -> None:
        self._note(CancelFlight(trial_id, request))

    def close(self) -> None:
        """Nothing is kept open between flights."""

    def _next(self) -> ToVehicleProcess:
        return self._answer

    @contextmanager
    def _vehicle_for(self, request: FlightRequest) -> Iterator[Vehicle]:
        self.error, is_held = None, False
        try:
            with open_vehicle(
                request.vehicle_kind,
                request.vehicle_options,
                safe_gains=request.safe_gains,
                trial_parameters=self._trial_parameters,
            ) as vehicle:
                self._hold(None)
                is_held = True
                yield vehicle
        except Exception as error:
            self.error, is_held = error, is_held and not isinstance(error, SafeGainsError)
            raise
        finally:
            if is_held:
                self._hold(request.safe_gains)
