"""PX4's logs of simulated flights, as the vehicle would write them with its default SDLOG_PROFILE."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Final

from app.autopilots.px4.replica.vertical import GRAVITY
from app.core.analysis.loop import LoggedFlight
from tests.logs.recorded import ULogFile

HOLD, MISSION, TAKEOFF, LAND, OFFBOARD, POSITION, RETURN = 4, 3, 17, 18, 14, 2, 5
READY, RAMP_UP, FLIGHT = 3, 4, 5

PARAMETERS: Final[Mapping[str, float]] = {
    "MPC_Z_P": 1.0,
    "MPC_Z_VEL_P_ACC": 4.0,
    "MPC_Z_VEL_I_ACC": 2.0,
    "MPC_Z_VEL_D_ACC": 0.0,
    "MPC_THR_HOVER": 0.35,
    "MPC_VEL_NF_FRQ": 0.0,
    "EKF2_PREDICT_US": 10_000,
    "IMU_INTEG_RATE": 250,
    "MAV_SYS_ID": 7,
}

_TOPICS: Final = (
    ("vehicle_local_position", "float z;float vz;uint8_t z_reset_counter;uint8_t vz_reset_counter;float az;", "ffBBf"),
    ("vehicle_local_position_setpoint", "float z;float vz;float[3] acceleration;float[3] thrust;", "8f"),
    ("vehicle_thrust_setpoint", "float[3] xyz;", "3f"),
    ("trajectory_setpoint", "float[3] position;float[3] velocity;float[3] acceleration;", "9f"),
    ("takeoff_status", "uint8_t takeoff_state;", "B"),
    ("vehicle_status", "uint8_t nav_state;uint8_t vehicle_type;", "BB"),
    ("vehicle_land_detected", "bool landed;bool ground_contact;", "??"),
    ("vehicle_constraints", "float speed_up;float speed_down;", "ff"),
)
_BEGIN_S: Final = 20.0
_NONE: Final = float("nan")


def px4_log(
    flight: LoggedFlight,
    *,
    parameters: Mapping[str, float] = PARAMETERS,
    changes: Sequence[tuple[float, str, float]] = (),
    modes: Sequence[tuple[float, int]] = ((0.0, HOLD),),
    takeoff: Sequence[tuple[float, int]] = ((0.0, FLIGHT),),
    landed: Sequence[tuple[float, bool]] = ((0.0, False),),
    resets: Sequence[tuple[float, int]] = ((0.0, 0),),
    without: Collection[str] = (),
    renamed: tuple[str, str] = ("", ""),
    has_altitude: bool = True,
    tilt: float = 0.0,
    feed_forward: bool = True,
    finer_thrust: Callable[[float], float] | None = None,
    set_points: int = 100_000,
    kind: int = 1,
) -> bytes:
    """The first segment of the flight, which begins at 20 s of the vehicle's clock; all times count from there.

    `without` names topics that were not logged, `renamed` has a part of their fields and what is in its place. `tilt`
    is the share of the thrust that is horizontal; manual modes give no altitude to follow, offboard control no rates.
    `finer_thrust` is the thrust as a function of time, logged half-way between the rows, too; only the first
    `set_points` of the trajectory are logged. `kind` is 1 for vehicles with rotors.
    """
    log = _defined(without, renamed)
    for name, value in parameters.items():
        log.parameter(name, value)
    for at_s, name, value in changes:
        log.parameter(name, value, at_s=_BEGIN_S + at_s)
    segment = flight.segments[0]
    thrust, hover = segment.throttle, segment.assumed_hover
    acceleration = -float(GRAVITY) * (thrust / hover - 1.0)
    for row, since_s in enumerate((segment.time_s - segment.time_s[0]).tolist()):
        at_s = _BEGIN_S + since_s
        moved = _latest(resets, since_s)
        log.add("vehicle_local_position", at_s, -segment.z_m[row], -segment.v_m_s[row], moved, 0, -segment.a_m_s2[row])
        z_d = -segment.z_d_m[row] if has_altitude else _NONE
        vertical = (z_d, -segment.v_t_m_s[row], 0.0, 0.0, acceleration[row], tilt * thrust[row], 0.0, -thrust[row])
        log.add("vehicle_local_position_setpoint", at_s, *vertical)
        if finer_thrust is not None:
            log.add("vehicle_thrust_setpoint", at_s + 0.048, 0.0, 0.0, -finer_thrust(at_s))
        if row % 2 == 0 and row < 2 * set_points:
            rates = (-segment.v_d_m_s[row], -segment.a_d_m_s2[row]) if feed_forward else (_NONE, _NONE)
            others = (0.0, 0.0)
            log.add("trajectory_setpoint", at_s, *others, z_d, *others, rates[0], *others, rates[1])
        if row % 10 == 0:
            log.add("vehicle_constraints", at_s, 3.0, 1.8)
    for since_s, state in takeoff:
        log.add("takeoff_status", _BEGIN_S + since_s, state)
    for since_s, mode in modes:
        log.add("vehicle_status", _BEGIN_S + since_s, mode, kind)
    for since_s, is_landed in landed:
        log.add("vehicle_land_detected", _BEGIN_S + since_s, is_landed, is_landed)
    return log.content


def _defined(without: Collection[str], renamed: tuple[str, str]) -> ULogFile:
    log = ULogFile()
    for topic, fields, layout in _TOPICS:
        if topic not in without:
            log.define(topic, fields.replace(*renamed) if renamed[0] else fields, layout)
    return log


def _latest(values: Sequence[tuple[float, int]], since_s: float) -> int:
    return [value for at_s, value in values if at_s <= since_s][-1]
