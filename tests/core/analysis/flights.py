"""Flights to analyse: the recorded one of the real binary, and simulated ones of known vehicles."""

import io
from dataclasses import replace

import numpy as np

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.logged_flight import ardupilot_flight
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import LEAD_S
from bench.copters.simulation import SimulatedCopter, fly_steps
from tests.logs.recorded import recorded

STEPS_BEGIN_S = 55.64

QUIET = SimulatedCopter(
    hover_throttle=0.4,
    assumed_hover_throttle=0.35,
    quadratic=0.0,
    motor_lag_s=0.05,
    dead_time_s=0.0,
    drag_1_s=0.3,
    drag_1_m=0.0,
    sag=0.0,
    gust_m_s2=0.0,
    noise_m_s2=0.002,
    wander_m_s=0.0,
    wander_m=0.0,
)
"""A vehicle of the model's own kind, in still air, with a trace of noise."""

GUSTY = replace(QUIET, gust_m_s2=0.2, noise_m_s2=0.1, wander_m_s=0.01, wander_m=0.01)


def recorded_steps() -> LoggedFlight:
    """The binary's flight with default gains, its 13 s of steps scored."""
    flight = ardupilot_flight(read_ardupilot(io.BytesIO(recorded("arducopter_steps.bin"))), "steps.bin")
    (segment,) = flight.segments
    rows = segment.time_s >= STEPS_BEGIN_S - LEAD_S
    names = type(segment).__slots__
    return replace(flight, segments=[replace(segment, **{name: getattr(segment, name)[rows] for name in names})])


def simulated_flight(copter: SimulatedCopter = QUIET, *, seed: int = 1, **gains: float) -> LoggedFlight:
    """Log of the steps with the vehicle, default gains but for those given."""
    parameters = replace(Parameters(hover_throttle=copter.assumed_hover_throttle), **gains)
    return fly_steps(copter, parameters, seed=seed).log


def parameters_of(flight: LoggedFlight) -> Parameters:
    """Those of the loop, which is ArduCopter's."""
    assert isinstance(flight.loop, ArduPilotLoop)
    return flight.loop.parameters


def with_gains_of(parameters: Parameters, position: float, velocity: float, p: float, i: float) -> Parameters:
    return replace(
        parameters,
        position_p_1_s=position,
        velocity_p_1_s=velocity,
        acceleration_p=p,
        acceleration_i_1_s=i,
    )


def rows_of(flight: LoggedFlight, name: str) -> np.ndarray:
    """A signal of all segments, shape (n,)."""
    return np.concatenate([getattr(each, name) for each in flight.segments])
