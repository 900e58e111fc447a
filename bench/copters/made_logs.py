"""Logs of altitude changes that random copters fly with default gains, as files, and what their parameters are.

The truth comes from the vehicle's own equations (`truth_of`), which are not those of the model: what a parameter of the
model means has to be said of a thrust polynomial, a falling battery, quadratic drag and a dead time.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import brentq

from app.autopilots.ardupilot.replica.parameters import STEP_S, Parameters
from app.autopilots.px4.replica import parameters as px4_parameters
from app.core.models.copter import GRAVITY_M_S2
from app.core.records.trajectory import Samples
from bench.copters import px4_simulation, simulation
from bench.copters.simulation import SimulatedCopter, StepFlight, move, packed
from tests.logs.copter_motions import older_steps
from tests.logs.written import ardupilot_log
from tests.logs.written_older_px4 import MOVE_S, Vehicle, Written, simulated
from tests.logs.written_px4 import PARAMETERS as PX4_PARAMETERS
from tests.logs.written_px4 import px4_log
from tests.logs.written_releases import RELEASES
from tests.logs.written_tlog import CLIMB_AND_DESCENT, PX4_RECORDING, Recording, fly

_LEAD_S: Final = 2.0
_NUDGE: Final = 0.01
_RESPONSE_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class MadeLog:
    """A log as a file, with its companion if it has one, and what is true of the vehicle that flew it, by the names of
    the answer."""

    content: bytes
    truth: Mapping[str, float]
    companion: bytes | None = None


def truth_of(
    copter: SimulatedCopter, *, lasts_s: float, climb_rate_m_s: Samples, step_s: float, begins_s: float = _LEAD_S
) -> dict[str, float]:
    """What the parameters of the model mean, of a vehicle whose flight begins to be analysed so long after its start.

    - hover throttle: carries the weight in the middle of what is analysed, where the battery has fallen that far;
    - thrust slope: of log thrust over log throttle, by a difference of 1 % to either side of that throttle;
    - drag: slope of the straight line through 0 that fits the drag best at the climb rates flown, shape (n,);
    - motor lag: how late the thrust follows a step of the throttle on average, with the dead time.
    """
    at_rest, at_s = packed(replace(copter, motor_lag_s=0.0), step_s), 0.5 * (begins_s + lasts_s)

    def acceleration(throttle: float, climb_m_s: float = 0.0) -> float:
        return move(np.array([throttle, 0.0, climb_m_s]), at_rest, throttle, at_s, 0.0, step_s)

    hover = float(brentq(acceleration, 0.01, 1.0))
    above, below = (np.log1p(acceleration(hover * factor) / GRAVITY_M_S2) for factor in (1.0 + _NUDGE, 1.0 - _NUDGE))
    drag = np.array([-acceleration(hover, each) for each in climb_rate_m_s.tolist()])
    return {
        "hover_throttle": hover,
        "thrust_slope": float(above - below) / float(np.log1p(_NUDGE) - np.log1p(-_NUDGE)),
        "motor_lag_s": _lateness_s(copter, hover, step_s),
        "drag_1_s": float(drag @ climb_rate_m_s / (climb_rate_m_s @ climb_rate_m_s)),
    }


def _lateness_s(copter: SimulatedCopter, hover: float, step_s: float) -> float:
    """Area between a small step of the throttle and the acceleration that it leads to."""
    constants, late, lagged = packed(copter, step_s), round(copter.dead_time_s / step_s), hover
    felt = np.zeros(round(_RESPONSE_S / step_s))
    before = move(np.array([hover, 0.0, 0.0]), constants, hover, 0.0, 0.0, step_s)
    for row in range(late, len(felt)):
        moving = np.array([lagged, 0.0, 0.0])
        felt[row] = move(moving, constants, hover * (1.0 + _NUDGE), 0.0, 0.0, step_s) - before
        lagged = float(moving[0])
    return step_s * float(np.sum(1.0 - felt / felt[-1]))


def dataflash(random: np.random.Generator) -> MadeLog:
    """ArduCopter's .bin."""
    return _ardupilot(random, is_upward=False)


def dataflash_of_4_1(random: np.random.Generator) -> MadeLog:
    """ArduCopter's .bin of release 4.1, with PSCZ."""
    return _ardupilot(random, is_upward=True)


def _ardupilot(random: np.random.Generator, *, is_upward: bool) -> MadeLog:
    copter = simulation.sample(random)
    parameters = Parameters(hover_throttle=copter.assumed_hover_throttle)
    flight = simulation.fly_steps(copter, parameters, seed=_seed(random))
    named = flight.log.loop.firmware_parameters
    return MadeLog(ardupilot_log(flight.log, parameters=named, is_upward=is_upward), _truth(copter, flight, STEP_S))


def dataflash_of_3_6(random: np.random.Generator) -> MadeLog:
    """ArduCopter's .bin of release 3.6, with CTUN and RATE, of steps in ALT_HOLD or GUIDED."""
    copter, seed, is_pilot = simulation.sample(random), _seed(random), bool(random.integers(2))
    begins_s = (8.0 + float(random.uniform()), 15.0 + float(random.uniform()))
    p_a = float(f"{copter.hover_throttle:.2g}")
    gains = (("PSC_ACCZ_P", p_a), ("PSC_ACCZ_I", 2.0 * p_a))
    motion = older_steps(feeds_rate=is_pilot, copter=copter, begins_s=begins_s, seed=seed, gains=gains)
    content = RELEASES["3.6"].log(motion, parameters={"MOT_THST_HOVER": copter.assumed_hover_throttle})
    truth = truth_of(copter, begins_s=6.0, lasts_s=24.0, climb_rate_m_s=motion.v_m_s, step_s=STEP_S)
    return MadeLog(content, truth)


def ulog_of_1_9(random: np.random.Generator) -> MadeLog:
    """PX4's .ulg of release 1.9, with ten thrusts a second, of steps in offboard control or of a mission."""
    copter, seed, manoeuvre = px4_simulation.sample_px4(random), _seed(random), ("steps", "smooth")[random.integers(2)]
    changes_s = tuple((6.0 + 7.0 * np.arange(5) + random.uniform(size=5)).tolist())
    vehicle = Vehicle(copter=copter, seed=seed, changes_s=changes_s)
    climb_rate_m_s = -simulated(manoeuvre, vehicle)["position"]["vz"]
    content = Written(layout="1.9", manoeuvre=manoeuvre, vehicle=vehicle).content
    return MadeLog(content, truth_of(copter, lasts_s=40.0, climb_rate_m_s=climb_rate_m_s, step_s=MOVE_S))


def ulog(random: np.random.Generator) -> MadeLog:
    """PX4's .ulg, of changes as in an auto mode, without the thrust between the rows."""
    copter = px4_simulation.sample_px4(random)
    parameters = px4_parameters.Parameters(hover_thrust=copter.assumed_hover_throttle)
    flight = px4_simulation.fly_changes(copter, parameters, seed=_seed(random))
    named = {**PX4_PARAMETERS, "MPC_THR_HOVER": copter.assumed_hover_throttle}
    return MadeLog(px4_log(flight.log, parameters=named), _truth(copter, flight, 0.5 * px4_parameters.STEP_S))


def telemetry_of_ardupilot(random: np.random.Generator) -> MadeLog:
    """The .tlog of steps in GUIDED under ArduCopter."""
    recording = Recording(set_points=CLIMB_AND_DESCENT, lasts_s=18.0)
    return _telemetry(random, recording, simulation.sample, "MOT_THST_HOVER", STEP_S)


def telemetry_of_px4(random: np.random.Generator) -> MadeLog:
    """The .tlog of steps in Offboard under PX4."""
    return _telemetry(random, PX4_RECORDING, px4_simulation.sample_px4, "MPC_THR_HOVER", 0.5 * px4_parameters.STEP_S)


def _telemetry(
    random: np.random.Generator,
    recording: Recording,
    sample: Callable[[np.random.Generator], SimulatedCopter],
    hover: str,
    step_s: float,
) -> MadeLog:
    copter = sample(random)
    signals = fly(recording.autopilot, copter, recording.set_points, recording.lasts_s, seed=_seed(random))
    named = {**recording.parameters, hover: copter.assumed_hover_throttle}
    content = replace(recording, parameters=named, signals=signals).content
    climb_rate_m_s = signals.climb_rate_m_s
    return MadeLog(content, truth_of(copter, lasts_s=recording.lasts_s, climb_rate_m_s=climb_rate_m_s, step_s=step_s))


def _truth(copter: SimulatedCopter, flight: StepFlight, step_s: float) -> dict[str, float]:
    (segment,) = flight.log.segments
    return truth_of(copter, lasts_s=segment.duration_s, climb_rate_m_s=segment.v_m_s, step_s=step_s)


def _seed(random: np.random.Generator) -> int:
    return int(random.integers(2**31))
