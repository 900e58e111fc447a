"""Twin of the paper's real flights: a simple vertical model with effects that the nominal model omits, and scatter.

Hover throttle (0.61), motor lag (50 ms) and start of the loop (0.3 s after the command) are fitted to the eight errors
of the paper's Table 2, which they reproduce within 8 %, and the scatter below to the two standard deviations of its
Fig. 12 (within 20 %): the paper publishes no record of a flight, so neither is evidence about the real drone.
Further physics (thrust that grows with the square of the command, ground effect, delayed measurement, a sagging
battery) is off by default.
"""

from typing import Final

import numpy as np

from app.core.control.vertical_guidance import RATE_HZ, STEP_S
from app.core.definition import Option
from app.core.errors import Problem
from app.core.experiments.vertical_loop import MODEL_PARAMETERS
from app.vehicles.kernels import AUTOPILOT_SIZE, BATTERY, CHANNELS, PAST, Integers, Rows, fly_simple_model
from app.vehicles.kinds import Hosts, Options, VehicleKind
from app.vehicles.simulated import FLIGHT_S, MAX_STEPS, gusts, opener, refuse_hover, streams

_THRUST_SD: Final = 0.003
_START_SD_S: Final = 0.060
_DATUM_SD_M: Final = 0.004
_GUST_SD_M_S2: Final = 0.05
_BATTERY_V: Final = 11.1


class TwinFlight:
    """One flight of the twin, a `Simulation` of `app.vehicles.simulated`.

    `options` are the complete options of the kind. The scatter between flights depends on `seed` alone; the gusts
    repeat after `MAX_STEPS`. `autopilot` is the loop's memory, which begins with the state of
    app.core.control.vertical_guidance.
    """

    def __init__(self, options: dict[str, float], seed: int) -> None:
        flight, gust = streams(seed, 2)
        thrust, start, datum = flight.standard_normal(3) * options["scatter"]
        self._sag_1_s = options["battery_sag"] / FLIGHT_S
        self._model = np.array([options[parameter.name] for parameter in MODEL_PARAMETERS])
        self._hover_force = _hover_force(options) / (1.0 + _THRUST_SD * thrust)
        self._ground_effect_height_m = options["ground_effect_height_m"]
        self._datum_m = float(_DATUM_SD_M * datum)
        self._gusts = gusts(gust, MAX_STEPS, sd=_GUST_SD_M_S2 * options["scatter"], correlation_s=0.5)
        self._resting = round(max(options["start_latency_s"] + _START_SD_S * start, 0.0) * RATE_HZ)
        self.autopilot = np.zeros(AUTOPILOT_SIZE, dtype=np.int64)
        self._plant = np.zeros(3)
        self._past = np.zeros((2, PAST))
        self._done = 0

    def advance(self, steps: int, command: Integers) -> Rows:
        """Implement `Simulation.advance`. The battery voltage is derived from the thrust, which is proportional to its
        square."""
        rows = np.zeros((steps, len(CHANNELS)))
        time_s = (self._done + np.arange(steps)) * STEP_S
        rows[:, BATTERY] = _BATTERY_V * np.sqrt(np.maximum(1.0 - self._sag_1_s * time_s, 0.0))
        fly_simple_model(
            self.autopilot,
            command,
            self._plant,
            self._past,
            self._model,
            self._hover_force,
            self._ground_effect_height_m,
            self._datum_m,
            np.take(self._gusts, np.arange(self._done, self._done + steps), mode="wrap"),
            self._resting,
            self._done,
            rows,
        )
        self._done += steps
        return rows


def _hover_force(options: Options) -> float:
    """`force_at_hover` of the options, without numba: the web process checks options and computes nothing else."""
    hover, quadratic = float(options["hover_throttle"]), float(options["quadratic_share"])
    return (1.0 - quadratic) * hover + quadratic * hover * hover


def _cannot_lift(options: Options, _simulation_hosts: Hosts) -> tuple[Problem, ...]:
    share = _hover_force(options) / (1.0 - float(options["battery_sag"]))
    return refuse_hover(
        "battery_sag", share, "leaves too little thrust: at the end of a flight, hovering needs {} of it"
    )


TWIN: Final = VehicleKind(
    name="twin",
    title="Twin of the paper's AR.Drone 2",
    line="A simple vertical model fitted to the published errors of the paper's real flights and to their scatter.",
    is_real=False,
    experiments=("takeoff", "altitude-steps"),
    options=(
        Option("scatter", "Flight-to-flight scatter, as a multiple of the real drone's", 1.0, "×", 0.0, 5.0),
        Option("hover_throttle", "Hover throttle", 0.61, "of full throttle", 0.3, 0.95),
        Option("motor_lag_s", "Motor lag", 0.05, "s", 0.0, 0.3),
        Option("start_latency_s", "Start latency", 0.3, "s", 0.0, 2.0),
        Option("drag_1_s", "Drag", 0.0, "per s", 0.0, 1.0),
        Option("quadratic_share", "Share of the thrust that grows with the command's square", 0.0, "", 0.0, 1.0),
        Option(
            "ground_effect", "Ground effect: extra thrust on the ground, as a share of the thrust", 0.0, "", 0.0, 0.5
        ),
        Option("ground_effect_height_m", "Height over which the ground effect fades", 0.4, "m", 0.1, 2.0),
        Option("measurement_delay_s", "Delay of the altitude and climb rate that the loop uses", 0.0, "s", 0.0, 0.1),
        Option("battery_sag", "Share of the thrust lost evenly over 33 s", 0.0, "", 0.0, 0.1),
    ),
    open=opener("twin", TwinFlight),
    find_conflicts=_cannot_lift,
)
