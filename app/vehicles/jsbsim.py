"""The simulated AR.Drone 2 that stands for that of the paper's Table 1: JSBSim, closed at 512 Hz around the autopilot's
vertical loop. The paper publishes no airframe: mass and thrust are those of Paparazzi's own `simple_ardrone2.xml`.

The aircraft file controls attitude, heading and horizontal position itself, so that each step exchanges only three
outputs (altitude, sink rate, tilt) and one input (thrust) with JSBSim.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from app.core.control.vertical_guidance import RATE_HZ, STEP_S
from app.core.definition import Option
from app.core.errors import Problem
from app.core.models.vertical import GRAVITY_M_S2
from app.vehicles.base import VehicleError
from app.vehicles.kernels import AUTOPILOT_SIZE, BATTERY, CHANNELS, COMMAND_SIZE, Integers, Rows, control
from app.vehicles.kinds import Hosts, Options, VehicleKind
from app.vehicles.simulated import MAX_STEPS, gusts, opener, refuse_hover, streams

if TYPE_CHECKING:
    import jsbsim


MASS_KG: Final = 0.4
FULL_THRUST_N: Final = 4 * 0.35 * 4.4482216

_FOOT_M: Final = 0.3048
_POUND_KG: Final = 0.45359237
_CENTRE_ABOVE_GROUND_M: Final = 0.1 - 0.00196
"""Height at which the four springs carry the weight."""

_GROUND_STEPS: Final = 4
"""Steps of JSBSim for one of the loop near the ground: the contacts settle in 1 ms, less than one step of the loop, and
at the loop's step JSBSim's integration of them oscillates."""
_CLEAR_OF_GROUND_M: Final = 0.02
_SETTLING_STEPS: Final = 200
_FULL_BATTERY_V: Final = 11.1


def new_aircraft() -> "jsbsim.FGFDMExec":
    """The AR.Drone 2 of the aircraft file, standing on its springs at 52° north, sea level, at 512 Hz; no wind.

    Raises VehicleError if JSBSim cannot load it. JSBSim is silenced by its own switch and not by a logger of ours: it
    keeps one logger per thread and releases it after Python has left the thread, which crashes the process.
    """
    import jsbsim

    jsbsim.FGJSBBase().debug_lvl = 0  # type: ignore[no-untyped-call]  # JSBSim's own gap in its types
    fdm = jsbsim.FGFDMExec(str(Path(__file__).parent))
    fdm.set_aircraft_path("aircraft")
    if not fdm.load_model("ardrone2"):
        raise VehicleError("JSBSim could not load the simulated vehicle.", hint="Reinstall Gainline.")
    fdm.set_dt(STEP_S)
    fdm["ic/lat-geod-deg"] = 52.0
    fdm["ic/h-agl-ft"] = _CENTRE_ABOVE_GROUND_M / _FOOT_M
    if not fdm.run_ic():
        raise VehicleError("JSBSim could not place the vehicle on the ground.", hint="Reinstall Gainline.")
    return fdm


class JsbsimFlight:
    """One flight in JSBSim, a `Simulation` of `app.vehicles.simulated`.

    `options` are the complete options of the kind. Gusts and sensor noise depend on `seed` alone and repeat after
    `MAX_STEPS`. `autopilot` is the loop's memory, which begins with the state of app.core.control.vertical_guidance.
    """

    def __init__(self, options: dict[str, float], seed: int) -> None:
        noise, *directions = streams(seed, 4)
        self._noise_m = noise.normal(0.0, options["altitude_noise_m"], MAX_STEPS)
        self._gusts_ft_s = (
            [
                gusts(direction, MAX_STEPS, sd=options["gust_m_s"] / _FOOT_M, correlation_s=1.0).tolist()
                for direction in directions
            ]
            if options["gust_m_s"] > 0.0
            else []
        )
        self._fdm = new_aircraft()
        self._configure(options)
        self._resting_steps = round(options["start_latency_s"] * RATE_HZ)
        self._sags = options["battery_sag"] > 0.0
        self.autopilot = np.zeros(AUTOPILOT_SIZE, dtype=np.int64)
        self._done = 0
        self._ground_m = self._settle()

    def advance(self, steps: int, command: Integers) -> Rows:
        """Implement `Simulation.advance`. The recorded altitude is the measured one, noise included."""
        rows = np.zeros((steps, len(CHANNELS)))
        rows[:, BATTERY] = _FULL_BATTERY_V
        altitude_ft = self._property("position/h-agl-ft").get_double_value
        sink_ft_s = self._property("velocities/v-down-fps").get_double_value
        cosine_of_tilt = self._property("attitude/cosine-of-tilt").get_double_value
        set_thrust = self._property("motors/thrust-norm").set_double_value
        run, autopilot, done, resting = self._fdm.run, self.autopilot, self._done, self._resting_steps
        noise_m = np.take(self._noise_m, np.arange(done, done + steps), mode="wrap").tolist()
        for i, (row, error_m) in enumerate(zip(rows, noise_m, strict=True)):
            altitude_m = altitude_ft() * _FOOT_M - self._ground_m
            set_thrust(
                control(
                    autopilot,
                    command,
                    altitude_m + error_m,
                    sink_ft_s() * -_FOOT_M,
                    cosine_of_tilt(),
                    done + i >= resting,
                    row,
                )
            )
            if self._sags or self._gusts_ft_s:
                self._exchange(done + i, row)
            if altitude_m > _CLEAR_OF_GROUND_M:
                run()
            else:
                self._run_near_ground()
        self._done += steps
        return rows

    def _property(self, path: str) -> "jsbsim.FGPropertyNode":
        """Return a handle, which avoids the search for the name at every access."""
        node = self._fdm.get_property_manager().get_node(path)
        if node is None:
            raise VehicleError(f"The simulated vehicle has no property {path}.", hint="Reinstall Gainline.")
        return node

    def _configure(self, options: dict[str, float]) -> None:
        fdm = self._fdm
        fdm["motors/thrust-scale"] = options["thrust_scale"]
        fdm["motors/lag-s"] = options["motor_lag_s"]
        fdm["battery/sag"] = options["battery_sag"]
        fdm["inertia/pointmass-weight-lbs"] = (options["mass_kg"] - MASS_KG) / _POUND_KG
        blows_to = math.radians(options["wind_from_deg"] + 180.0)
        fdm["atmosphere/wind-north-fps"] = options["wind_m_s"] / _FOOT_M * math.cos(blows_to)
        fdm["atmosphere/wind-east-fps"] = options["wind_m_s"] / _FOOT_M * math.sin(blows_to)

    def _settle(self) -> float:
        """Let the vehicle settle on its springs; return the height of its centre then, m."""
        for _ in range(_SETTLING_STEPS):
            self._run_near_ground()
        return self._fdm["position/h-agl-ft"] * _FOOT_M

    def _run_near_ground(self) -> None:
        self._fdm.set_dt(STEP_S / _GROUND_STEPS)
        for _ in range(_GROUND_STEPS):
            self._fdm.run()
        self._fdm.set_dt(STEP_S)

    def _exchange(self, step: int, row: Rows) -> None:
        """Set the gusts and read the battery voltage, which only some flights have."""
        if self._gusts_ft_s:
            for axis, series in zip(("north", "east", "down"), self._gusts_ft_s, strict=True):
                self._fdm[f"atmosphere/gust-{axis}-fps"] = series[step % MAX_STEPS]
        row[BATTERY] = _FULL_BATTERY_V * self._fdm["battery/voltage-norm"]


def prepare() -> None:
    """Load JSBSim, its aircraft and the compiled autopilot, so that the first flight need not wait for them."""
    options = {option.name: float(option.default) for option in JSBSIM.options}
    JsbsimFlight(options, seed=0).advance(1, np.zeros(COMMAND_SIZE, dtype=np.int64))


def _cannot_lift(options: Options, _simulation_hosts: Hosts) -> tuple[Problem, ...]:
    """Report a mass that needs more than `HIGHEST_HOVER` of full thrust to hover.

    A sagging battery at hover throttle h leaves (1 − sag·h)² of the thrust; at full command (1 − sag)².
    """
    strength = float(options["thrust_scale"]) * (1.0 - float(options["battery_sag"])) ** 2
    share = float(options["mass_kg"]) * GRAVITY_M_S2 / (FULL_THRUST_N * strength)
    reason = "is too much for these motors and this battery: hovering needs {} of full thrust"
    return refuse_hover("mass_kg", share, reason)


JSBSIM: Final = VehicleKind(
    name="jsbsim",
    title="Simulated AR.Drone 2",
    line="Six degrees of freedom in JSBSim under the autopilot's own vertical loop, as the paper's Table 1 was flown.",
    is_real=False,
    experiments=("takeoff", "altitude-steps"),
    options=(
        Option("thrust_scale", "Thrust, as a multiple of the airframe's", 1.0, "×", 0.7, 1.5),
        Option("mass_kg", "Mass", MASS_KG, "kg", 0.3, 0.6),
        Option("motor_lag_s", "Motor lag", 0.0, "s", 0.0, 0.15),
        Option("start_latency_s", "Start latency", 0.0, "s", 0.0, 2.0),
        Option("wind_m_s", "Steady wind", 0.0, "m/s", 0.0, 10.0),
        Option("wind_from_deg", "Direction the wind comes from, clockwise from north", 0.0, "°", 0.0, 360.0),
        Option("gust_m_s", "Gusts in each direction, root mean square", 0.0, "m/s", 0.0, 3.0),
        Option("altitude_noise_m", "Noise of the measured altitude, standard deviation", 0.0, "m", 0.0, 0.1),
        Option("battery_sag", "Share of the voltage lost under full load", 0.0, "of the voltage", 0.0, 0.2),
    ),
    open=opener("jsbsim", JsbsimFlight),
    find_conflicts=_cannot_lift,
)
