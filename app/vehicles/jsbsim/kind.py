"""The simulated AR.Drone 2 of the paper's Table 1, with its settings."""

from pathlib import Path
from typing import Final

import numpy as np

from app.core.errors import Problem
from app.core.formatting import percent
from app.core.policy import Gains
from app.vehicles.base import Vehicle, VehicleOption
from app.vehicles.jsbsim.flight import FULL_THRUST_N, GRAVITY_M_S2, MASS_KG, JsbsimFlight
from app.vehicles.kernels import COMMAND_SIZE
from app.vehicles.kinds import Hosts, Options, VehicleKind
from app.vehicles.simulated import SimulatedVehicle

_HIGHEST_HOVER: Final = 0.95


def _open(options: Options, safe_gains: Gains, _trial_parameters: Path | None) -> Vehicle:
    numbers = {name: float(value) for name, value in options.items()}
    return SimulatedVehicle("jsbsim", safe_gains, options, lambda order: JsbsimFlight(numbers, order.seed))


def prepare() -> None:
    """Load JSBSim, its aircraft and the compiled autopilot, which the first flight would otherwise wait for."""
    options = {option.name: float(option.default) for option in JSBSIM.options}
    JsbsimFlight(options, seed=0).advance(1, np.zeros(COMMAND_SIZE, dtype=np.int64))


def _cannot_lift(options: Options, _simulation_hosts: Hosts) -> tuple[Problem, ...]:
    """A sagging battery at hover throttle h leaves (1 − sag·h)² of the thrust; at full command (1 − sag)²."""
    strength = float(options["thrust_scale"]) * (1.0 - float(options["battery_sag"])) ** 2
    share = float(options["mass_kg"]) * GRAVITY_M_S2 / (FULL_THRUST_N * strength)
    if share <= _HIGHEST_HOVER:
        return ()
    return (
        Problem(
            "mass_kg",
            f"is too much for these motors and this battery: it takes {percent(share)} of full thrust, "
            f"at most {percent(_HIGHEST_HOVER)} leaves room to control",
        ),
    )


JSBSIM: Final = VehicleKind(
    name="jsbsim",
    title="Simulated AR.Drone 2",
    line="Six degrees of freedom in JSBSim under the autopilot's own vertical loop, as flown for the paper's Table 1.",
    is_real=False,
    can_fly=True,
    experiments=("takeoff",),
    options=(
        VehicleOption(
            name="thrust_scale",
            title="Thrust, as a multiple of the data sheet's",
            unit="×",
            default=1.0,
            lower=0.7,
            upper=1.5,
        ),
        VehicleOption(name="mass_kg", title="Mass", unit="kg", default=MASS_KG, lower=0.3, upper=0.6),
        VehicleOption(name="motor_lag_s", title="Motor lag", unit="s", default=0.0, lower=0.0, upper=0.15),
        VehicleOption(name="start_latency_s", title="Start latency", unit="s", default=0.0, lower=0.0, upper=2.0),
        VehicleOption(name="wind_m_s", title="Steady wind", unit="m/s", default=0.0, lower=0.0, upper=10.0),
        VehicleOption(
            name="wind_from_deg",
            title="Direction the wind comes from, clockwise from north",
            unit="°",
            default=0.0,
            lower=0.0,
            upper=360.0,
        ),
        VehicleOption(
            name="gust_m_s",
            title="Gusts in each direction, root mean square",
            unit="m/s",
            default=0.0,
            lower=0.0,
            upper=3.0,
        ),
        VehicleOption(
            name="altitude_noise_m",
            title="Noise of the measured altitude, standard deviation",
            unit="m",
            default=0.0,
            lower=0.0,
            upper=0.1,
        ),
        VehicleOption(
            name="battery_sag",
            title="Share of the voltage lost under full load",
            unit="of full",
            default=0.0,
            lower=0.0,
            upper=0.2,
        ),
    ),
    open=_open,
    find_conflicts=_cannot_lift,
)
