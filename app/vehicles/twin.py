"""The twin of the paper's real flights: a simple vertical model with what the nominal one leaves out, and scatter.

Hover throttle 0.61, a motor lag of 50 ms and a loop entered 0.3 s after the command score every row of the paper's
Table 2 within 8 %; with the scatter below, repeated takeoffs differ as in its Fig. 12.
"""

from typing import Final

import numpy as np

from app.core.control.vertical_loop import RATE_HZ
from app.core.policy import Gains
from app.vehicles.base import Vehicle, VehicleOption
from app.vehicles.disturbances import gusts, streams
from app.vehicles.kernels import AUTOPILOT_SIZE, BATTERY, CHANNELS, Integers, Rows, fly_simple_model
from app.vehicles.kinds import Options, VehicleKind
from app.vehicles.simulated import MOST_STEPS, SimulatedVehicle

_THRUST_SD: Final = 0.003
_START_SD_S: Final = 0.060
_DATUM_SD_M: Final = 0.004
_GUST_SD_M_S2: Final = 0.05
_GUST_CORRELATION_S: Final = 0.5
_BATTERY_V: Final = 11.1


class _TwinFlight:
    def __init__(self, options: dict[str, float], seed: int) -> None:
        flight, gust = streams(seed, 2)
        thrust, start, datum = flight.standard_normal(3) * options["scatter"]
        self._model = np.array(
            [options["hover_throttle"] / (1.0 + _THRUST_SD * thrust), options["motor_lag_s"], options["drag_1_s"]]
        )
        self._datum_m = float(_DATUM_SD_M * datum)
        self._gusts = gusts(gust, MOST_STEPS, sd=_GUST_SD_M_S2 * options["scatter"], correlation_s=_GUST_CORRELATION_S)
        self._resting = round(max(options["start_latency_s"] + _START_SD_S * start, 0.0) * RATE_HZ)
        self._autopilot = np.zeros(AUTOPILOT_SIZE, dtype=np.int64)
        self._plant = np.zeros(3)
        self._done = 0

    def advance(self, steps: int, command: Integers) -> Rows:
        rows = np.empty((steps, len(CHANNELS)))
        rows[:, BATTERY] = _BATTERY_V
        fly_simple_model(
            self._autopilot,
            command,
            self._plant,
            self._model,
            self._datum_m,
            self._gusts[self._done : self._done + steps],
            max(self._resting - self._done, 0),
            rows,
        )
        self._done += steps
        return rows


def _open(options: Options, safe_gains: Gains) -> Vehicle:
    numbers = {name: float(value) for name, value in options.items()}
    return SimulatedVehicle("twin", safe_gains, options, lambda order: _TwinFlight(numbers, order.seed))


TWIN: Final = VehicleKind(
    name="twin",
    title="Twin of the paper's AR.Drone 2",
    line="A simple vertical model fitted to the paper's real flights, with their flight-to-flight scatter.",
    is_real=False,
    can_fly=True,
    options=(
        VehicleOption(
            name="scatter",
            title="Flight-to-flight scatter, as a multiple of the real drone's",
            unit="×",
            default=1.0,
            lower=0.0,
            upper=5.0,
        ),
        VehicleOption(
            name="hover_throttle", title="Hover throttle", unit="of full", default=0.61, lower=0.3, upper=0.95
        ),
        VehicleOption(name="motor_lag_s", title="Motor lag", unit="s", default=0.05, lower=0.0, upper=0.3),
        VehicleOption(name="start_latency_s", title="Start latency", unit="s", default=0.3, lower=0.0, upper=2.0),
        VehicleOption(name="drag_1_s", title="Drag", unit="1/s", default=0.0, lower=0.0, upper=1.0),
    ),
    open=_open,
)
