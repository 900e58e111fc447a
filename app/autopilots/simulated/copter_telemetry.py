"""Messages that both ArduPilot and PX4 send, from a snapshot of their state."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.autopilots.simulated.body import ARMED, Fields
from app.autopilots.simulated.copter_control import IGNORE_AZ, IGNORE_VZ, IGNORE_Z, LOCAL_NED, AltitudeController

LATITUDE_E7: Final = 473977420
LONGITUDE_E7: Final = 85455940
HOME_AMSL_M: Final = 488.0
FULL_V: Final = 11.1

ON_GROUND: Final = 1
IN_AIR: Final = 2
TAKING_OFF: Final = 3
LANDING: Final = 4
"""MAV_LANDED_STATE."""

_IGNORE_HORIZONTAL: Final = 0b110011011000
"""Horizontal speed and acceleration, yaw and its rate; x and y are those of the place, which it keeps."""
_NOISE_M_S: Final = 2e-6
_NOISE_MS: Final = 20
"""An estimate is never the same twice."""
_PREARM: Final = 1 << 28
_SENSORS: Final = 1 | 2 | 4 | 8 | 32 | (1 << 10) | (1 << 11) | (1 << 15) | (1 << 25)
"""Gyroscope, accelerometer, magnetometer, pressure, GPS, attitude and yaw control, motors, battery."""
_ARDUPILOT: Final = 3


@dataclass(frozen=True, slots=True)
class Snapshot:
    """State of the autopilot; `local_m` is in the local frame, `altitude_m` above the place of takeoff, both up."""

    boot_s: float
    north_m: float
    north_m_s: float
    local_m: float
    altitude_m: float
    climb_rate_m_s: float
    thrust: float
    battery_v: float
    armed: bool
    autopilot: int
    base_mode: int
    custom_mode: int
    status: int
    landed_state: int
    version: int
    uid: int
    breach_type: int
    breaches: int
    ready: bool
    """Whether its arming checks pass."""
    controller: AltitudeController

    @property
    def boot_ms(self) -> int:
        return int(self.boot_s * 1000.0)

    @property
    def charge_percent(self) -> int:
        return round(min(max((self.battery_v / FULL_V - 0.8) / 0.2, 0.0), 1.0) * 100.0)


def heartbeat(now: Snapshot) -> Fields:
    return {
        "type": 2,
        "autopilot": now.autopilot,
        "base_mode": now.base_mode | (ARMED if now.armed else 0),
        "custom_mode": now.custom_mode,
        "system_status": now.status,
        "mavlink_version": 3,
    }


def local_position(now: Snapshot) -> Fields:
    down = {"z": -now.local_m, "vz": -now.climb_rate_m_s - _NOISE_M_S * (now.boot_ms // _NOISE_MS % 2)}
    return {"time_boot_ms": now.boot_ms, "x": now.north_m, "y": 0.0, "vx": now.north_m_s, "vy": 0.0, **down}


def global_position(now: Snapshot) -> Fields:
    return {
        "time_boot_ms": now.boot_ms,
        "lat": LATITUDE_E7,
        "lon": LONGITUDE_E7,
        "alt": round((HOME_AMSL_M + now.altitude_m) * 1000.0),
        "relative_alt": round(now.altitude_m * 1000.0),
        "vx": 0,
        "vy": 0,
        "vz": round(-now.climb_rate_m_s * 100.0),
        "hdg": 0,
    }


def attitude(now: Snapshot) -> Fields:
    return {"time_boot_ms": now.boot_ms, **dict.fromkeys(_ATTITUDE, 0.0)}


def position_target(now: Snapshot) -> Fields:
    """Return POSITION_TARGET_LOCAL_NED: the set point in force, not the shaped one."""
    given = now.controller.set_point
    up = {"z": given.altitude_m + now.local_m - now.altitude_m, "vz": given.climb_m_s, "afz": given.acceleration_m_s2}
    missing = {name for name, value in up.items() if math.isnan(value)}
    ignored = sum(bit for name, bit in (("z", IGNORE_Z), ("vz", IGNORE_VZ), ("afz", IGNORE_AZ)) if name in missing)
    return {
        "time_boot_ms": now.boot_ms,
        "coordinate_frame": LOCAL_NED,
        "type_mask": ignored | _IGNORE_HORIZONTAL,
        **dict.fromkeys(("x", "y", "vx", "vy", "afx", "afy", "yaw", "yaw_rate"), 0.0),
        **{name: 0.0 if name in missing else -value for name, value in up.items()},
    }


def attitude_target(now: Snapshot) -> Fields:
    level = {"type_mask": 0, "q": [1.0, 0.0, 0.0, 0.0]}
    rates = dict.fromkeys(("body_roll_rate", "body_pitch_rate", "body_yaw_rate"), 0.0)
    return {"time_boot_ms": now.boot_ms, **level, **rates, "thrust": now.controller.demand}


def controller_output(now: Snapshot) -> Fields:
    whole = dict.fromkeys(("nav_bearing", "target_bearing", "wp_dist"), 0)
    rest = dict.fromkeys(("nav_roll", "nav_pitch", "aspd_error", "xtrack_error"), 0.0)
    return {**whole, **rest, "alt_error": now.controller.error_m}


def vfr_hud(now: Snapshot) -> Fields:
    return {
        "airspeed": 0.0,
        "groundspeed": 0.0,
        "heading": 0,
        "throttle": round(now.thrust * 100.0),
        "alt": HOME_AMSL_M + now.altitude_m,
        "climb": now.climb_rate_m_s,
    }


def sys_status(now: Snapshot) -> Fields:
    """Return SYS_STATUS. PX4 sets the bit of its arming checks in the health alone, since release 1.14."""
    present = _SENSORS | (_PREARM if now.autopilot == _ARDUPILOT else 0)
    errors = dict.fromkeys(("drop_rate_comm", "errors_comm", *(f"errors_count{i}" for i in range(1, 5))), 0)
    return {
        "onboard_control_sensors_present": present,
        "onboard_control_sensors_enabled": present,
        "onboard_control_sensors_health": _SENSORS | (_PREARM if now.ready else 0),
        "load": 200,
        "voltage_battery": round(now.battery_v * 1000.0),
        "current_battery": -1,
        "battery_remaining": now.charge_percent,
        **errors,
    }


def battery_status(now: Snapshot) -> Fields:
    return {
        "id": 0,
        "battery_function": 0,
        "type": 1,
        "temperature": 32767,
        "voltages": [round(now.battery_v * 1000.0), *[65535] * 9],
        "current_battery": -1,
        "current_consumed": -1,
        "energy_consumed": -1,
        "battery_remaining": now.charge_percent,
    }


def gps_raw(now: Snapshot) -> Fields:
    return {
        "time_usec": round(now.boot_s * 1e6),
        "fix_type": 3,
        "lat": LATITUDE_E7,
        "lon": LONGITUDE_E7,
        "alt": round((HOME_AMSL_M + now.altitude_m) * 1000.0),
        "eph": 90,
        "epv": 120,
        "vel": 0,
        "cog": 0,
        "satellites_visible": 12,
    }


def home_position(_now: Snapshot) -> Fields:
    place = {"latitude": LATITUDE_E7, "longitude": LONGITUDE_E7, "altitude": round(HOME_AMSL_M * 1000.0)}
    zeros = dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), 0.0)
    return {**place, **zeros, "q": [1.0, 0.0, 0.0, 0.0]}


def system_time(now: Snapshot) -> Fields:
    return {"time_unix_usec": 0, "time_boot_ms": now.boot_ms}


def extended_state(now: Snapshot) -> Fields:
    return {"vtol_state": 0, "landed_state": now.landed_state}


def fence_status(now: Snapshot) -> Fields:
    return {
        "breach_status": int(now.breach_type != 0),
        "breach_count": now.breaches,
        "breach_type": now.breach_type,
        "breach_time": 0,
    }


def autopilot_version(now: Snapshot) -> Fields:
    """Return AUTOPILOT_VERSION, with only the implemented capabilities: MAVLink 2 and parameters as floats."""
    custom = dict.fromkeys(("flight_custom_version", "middleware_custom_version", "os_custom_version"), [0] * 8)
    numbers = dict.fromkeys(("middleware_sw_version", "os_sw_version", "board_version", "vendor_id", "product_id"), 0)
    return {"capabilities": 2 | (1 << 13), "flight_sw_version": now.version, **numbers, "uid": now.uid, **custom}


_ATTITUDE: Final = ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")


@dataclass(frozen=True, slots=True)
class Report:
    """A message's number, and the function of its fields."""

    number: int
    fields: Callable[[Snapshot], Fields]


REPORTS: Final[Mapping[str, Report]] = MappingProxyType(
    {
        "HEARTBEAT": Report(0, heartbeat),
        "SYS_STATUS": Report(1, sys_status),
        "SYSTEM_TIME": Report(2, system_time),
        "GPS_RAW_INT": Report(24, gps_raw),
        "ATTITUDE": Report(30, attitude),
        "LOCAL_POSITION_NED": Report(32, local_position),
        "GLOBAL_POSITION_INT": Report(33, global_position),
        "NAV_CONTROLLER_OUTPUT": Report(62, controller_output),
        "VFR_HUD": Report(74, vfr_hud),
        "ATTITUDE_TARGET": Report(83, attitude_target),
        "POSITION_TARGET_LOCAL_NED": Report(85, position_target),
        "BATTERY_STATUS": Report(147, battery_status),
        "AUTOPILOT_VERSION": Report(148, autopilot_version),
        "FENCE_STATUS": Report(162, fence_status),
        "HOME_POSITION": Report(242, home_position),
        "EXTENDED_SYS_STATE": Report(245, extended_state),
    }
)
KINDS_BY_NUMBER: Final[Mapping[int, str]] = MappingProxyType({report.number: kind for kind, report in REPORTS.items()})
