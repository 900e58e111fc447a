"""Flights under PX4 to analyse: those of the real binary in its own simulation, and simulated ones of vehicles that are
known."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.px4.replica.parameters import Parameters
from app.autopilots.px4.replica.vertical import FLIGHT, GRAVITY, INPUTS, OUTPUTS
from app.autopilots.px4.replica_check import read_px4_trace
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import FinerSegment
from app.core.records.trajectory import Samples
from bench.copters.px4_simulation import Manoeuvre, fly_changes
from bench.copters.simulation import SimulatedCopter

TRACES = Path(__file__).parents[2] / "data" / "px4_loop"
EVENT_LASTS_S = 5.0
_EVERY, _THRUST_EVERY = 12, 3

CALM = SimulatedCopter(
    hover_throttle=0.4,
    assumed_hover_throttle=0.4,
    quadratic=0.2,
    motor_lag_s=0.05,
    dead_time_s=0.004,
    drag_1_s=0.3,
    drag_1_m=0.02,
    sag=0.01,
    gust_m_s2=0.1,
    noise_m_s2=0.1,
    wander_m_s=0.02,
    wander_m=0.01,
)

SLOW = replace(CALM, motor_lag_s=0.2, dead_time_s=0.01)


def simulated_px4(
    copter: SimulatedCopter = CALM, *, seed: int = 1, manoeuvre: Manoeuvre = "auto", **gains: float
) -> LoggedFlight:
    """Log of the altitude changes with the vehicle, default gains but for those given."""
    parameters = replace(Parameters(hover_thrust=copter.assumed_hover_throttle), **gains)
    return fly_changes(copter, parameters, seed=seed, manoeuvre=manoeuvre).log


def traced(name: str) -> LoggedFlight:
    """The binary's flight of offboard steps and a push, ten rows a second and the thrust four times as often, as PX4
    logs them, from the beginning of offboard control on."""
    with (TRACES / f"{name}_steps_push.csv.gz").open("rb") as stream:
        trace = read_px4_trace(stream, name=name)
    given = {name: trace.inputs[:, place] for place, name in enumerate(INPUTS)}
    given |= {name: trace.outputs[:, place] for place, name in enumerate(OUTPUTS)}
    offboard = np.flatnonzero((given["takeoff_state"] == FLIGHT) & np.isnan(given["set_vz_m_s"]))
    rows = np.arange(offboard[0], offboard[-1] + 1, _EVERY)
    time_s, v_m_s = trace.time_s[rows], -given["vz_m_s"][rows]
    changes = np.diff(v_m_s) / np.diff(time_s)
    thrust = given["out_thrust"][rows]
    share = 1.0 - given["out_az_m_s2"][rows] / float(GRAVITY)
    free = (thrust > 0.13) & (share > 0.2)
    finer = np.arange(rows[0], rows[-1] + 1, _THRUST_EVERY)
    segment = FinerSegment(
        motor_time_s=trace.time_s[finer],
        motor_values=given["out_thrust"][finer],
        time_s=time_s,
        z_m=-given["z_m"][rows],
        v_m_s=v_m_s,
        a_m_s2=np.append(changes[0], changes),
        z_d_m=-given["set_z_m"][rows],
        v_d_m_s=-np.nan_to_num(given["set_vz_m_s"][rows]),
        a_d_m_s2=-np.nan_to_num(given["set_az_m_s2"][rows]),
        v_t_m_s=-given["out_vz_m_s"][rows],
        throttle=thrust,
        throttle_filtered=thrust,
        assumed_hover=np.interp(time_s, time_s[free], thrust[free] / share[free]),
    )
    loop = Px4Loop(parameters=trace.parameters, step_s=0.008, row_s=_EVERY * 0.008, descent_m_s=1.5)
    return LoggedFlight(loop=loop, segments=[segment])


def event_error_m(flight: LoggedFlight, z_m: Samples) -> float:
    """Mean distance of the altitude `z_m`, shape (n,), from the target in the 5 s after each step and each end of the
    push."""
    (segment,) = flight.segments
    steps = np.flatnonzero(np.abs(np.diff(segment.z_d_m)) > 0.3) + 1
    pushed = np.flatnonzero(np.abs(segment.a_d_m_s2) > 0.5)
    events = segment.time_s[[*steps, pushed[0], pushed[-1] + 1]]
    after = [(segment.time_s >= at_s) & (segment.time_s < at_s + EVENT_LASTS_S) for at_s in events.tolist()]
    return float(np.mean([np.abs(segment.z_d_m - z_m)[each].mean() for each in after]))
