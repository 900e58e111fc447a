"""Messages that both ArduPilot and PX4 send of their state."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import ClassVar, Final

from app.autopilots.simulated.body import (
    ARMED,
    FULL_BATTERY_V,
    Body,
    Fields,
    SimulatedAutopilot,
    timed,
)
from app.autopilots.simulated.copter_control import (
    IGNORED_BY,
    LOCAL_NED,
    AltitudeController,
    Phase,
)
from app.autopilots.simulated.copter_parameters import FirmwareProfile, Parameters

LATITUDE_E7: Final = 473977420
LONGITUDE_E7: Final = 85455940
HOME_AMSL_M: Final = 488.0

_LANDED_STATES: Final = {Phase.IDLE: 1, Phase.HOLDING: 2, Phase.CLIMBING: 3, Phase.LANDING: 4}
"""MAV_LANDED_STATE."""
_SIMULATED: Final = int.from_bytes(b"GAINLIN\0", "big")
"""Hardware id of a simulated drone, except its last byte."""
_TEXT_LENGTH: Final = 50
_LAST_TEXT: Final = 65535
_ACTIVE: Final = 4
_STANDBY: Final = 3
_ALTITUDE_BREACH: Final = 2

_IGNORE_HORIZONTAL: Final = 0b110011011000
"""Horizontal speed and acceleration, yaw and its rate; x and y are those of the place, which it keeps."""
_NOISE_M_S: Final = 2e-6
_NOISE_MS: Final = 20
"""An estimate is never the same twice."""
_PREARM: Final = 1 << 28
_SENSORS: Final = 1 | 2 | 4 | 8 | 32 | (1 << 10) | (1 << 11) | (1 << 15) | (1 << 25)
"""Gyroscope, accelerometer, magnetometer, pressure, GPS, attitude and yaw control, motors, battery."""
_ARDUPILOT: Final = 3


class ReportingCopter(SimulatedAutopilot):
    """What the reports of a copter are of: its state, beside its body and the controller that flies it."""

    component = 1
    list_ticks = 2
    firmware: ClassVar[FirmwareProfile]

    def __init__(self, body: Body, controller: AltitudeController, *, system: int) -> None:
        firmware = self.firmware
        super().__init__(body, firmware.dialect, Parameters(firmware.parameters), firmware.periods_s, system=system)
        self.uid = _SIMULATED | system
        self.estimate_after_s = 3.0
        """Time from the start until the position is known well enough to arm and to be sent."""
        self.mode = firmware.modes[0]
        self.controller = controller
        self.is_breached, self.breaches = False, 0
        self._texts = 0

    def prearm_failure(self) -> str | None:
        """Return why its arming checks do not pass, as reported regularly; None if they pass."""
        return self.firmware.no_estimate if self.refuses_arming or not self.has_estimate else None

    @property
    def has_estimate(self) -> bool:
        return self.boot_s >= self.estimate_after_s

    @property
    def charge_percent(self) -> int:
        return round(min(max((self.body.battery_v / FULL_BATTERY_V - 0.8) / 0.2, 0.0), 1.0) * 100.0)

    def send_text(self, text: str) -> None:
        """Send a critical STATUSTEXT; a long text is sent in several chunks with one number."""
        self._texts = self._texts % _LAST_TEXT + 1 if len(text) > _TEXT_LENGTH else self._texts
        for chunk, start in enumerate(range(0, len(text), _TEXT_LENGTH)):
            number = self._texts if len(text) > _TEXT_LENGTH else 0
            part = text[start : start + _TEXT_LENGTH]
            self._send("STATUSTEXT", {"severity": 2, "text": part, "id": number, "chunk_seq": chunk})


def position_target(now: ReportingCopter) -> Fields:
    """Return POSITION_TARGET_LOCAL_NED: the set point in force, not the shaped one."""
    given = now.controller.set_point
    up = {"z": given.altitude_m + now.firmware.ground_m, "vz": given.climb_m_s, "afz": given.acceleration_m_s2}
    missing = {name for name, value in up.items() if math.isnan(value)}
    ignored = sum(IGNORED_BY[name] for name in missing)
    return {
        "time_boot_ms": now.boot_ms,
        "coordinate_frame": LOCAL_NED,
        "type_mask": ignored | _IGNORE_HORIZONTAL,
        **{name: 0.0 if name in missing else -value for name, value in up.items()},
    }


def sys_status(now: ReportingCopter) -> Fields:
    """Return SYS_STATUS. PX4 sets the bit of its arming checks in the health alone, since release 1.14."""
    present = _SENSORS | (_PREARM if now.firmware.autopilot == _ARDUPILOT else 0)
    return {
        "onboard_control_sensors_present": present,
        "onboard_control_sensors_enabled": present,
        "onboard_control_sensors_health": _SENSORS | (_PREARM if now.prearm_failure() is None else 0),
        "load": 200,
        "voltage_battery": round(now.body.battery_v * 1000.0),
        "current_battery": -1,
        "battery_remaining": now.charge_percent,
    }


REPORTS: Final[Mapping[str, Callable[[ReportingCopter], Fields]]] = MappingProxyType(
    {
        "HEARTBEAT": lambda now: {
            "type": 2,
            "autopilot": now.firmware.autopilot,
            "base_mode": now.mode.base_mode | (ARMED if now.armed else 0),
            "custom_mode": now.mode.custom_mode,
            "system_status": _ACTIVE if now.controller.flies else _STANDBY,
            "mavlink_version": 3,
        },
        "SYS_STATUS": sys_status,
        "SYSTEM_TIME": timed,
        "GPS_RAW_INT": lambda now: {
            "time_usec": round(now.boot_s * 1e6),
            "fix_type": 3,
            "lat": LATITUDE_E7,
            "lon": LONGITUDE_E7,
            "alt": round((HOME_AMSL_M + now.body.altitude_m) * 1000.0),
            "eph": 90,
            "epv": 120,
            "satellites_visible": 12,
        },
        "ATTITUDE": timed,
        "LOCAL_POSITION_NED": lambda now: {
            "time_boot_ms": now.boot_ms,
            "x": now.body.north_m,
            "z": -(now.body.altitude_m + now.firmware.ground_m),
            "vx": now.body.north_m_s,
            "vz": -now.body.climb_rate_m_s - _NOISE_M_S * (now.boot_ms // _NOISE_MS % 2),
        },
        "GLOBAL_POSITION_INT": lambda now: {
            "time_boot_ms": now.boot_ms,
            "lat": LATITUDE_E7,
            "lon": LONGITUDE_E7,
            "alt": round((HOME_AMSL_M + now.body.altitude_m) * 1000.0),
            "relative_alt": round(now.body.altitude_m * 1000.0),
            "vz": round(-now.body.climb_rate_m_s * 100.0),
        },
        "NAV_CONTROLLER_OUTPUT": lambda now: {"alt_error": now.controller.error_m},
        "VFR_HUD": lambda now: {
            "throttle": round(now.body.thrust * 100.0),
            "alt": HOME_AMSL_M + now.body.altitude_m,
            "climb": now.body.climb_rate_m_s,
        },
        "ATTITUDE_TARGET": lambda now: {
            "time_boot_ms": now.boot_ms,
            "q": [1.0, 0.0, 0.0, 0.0],  # level
            "thrust": now.controller.demand,
        },
        "POSITION_TARGET_LOCAL_NED": position_target,
        "BATTERY_STATUS": lambda now: {
            "type": 1,
            "temperature": 32767,
            "voltages": [round(now.body.battery_v * 1000.0), *[65535] * 9],
            "current_battery": -1,
            "current_consumed": -1,
            "energy_consumed": -1,
            "battery_remaining": now.charge_percent,
        },
        "AUTOPILOT_VERSION": lambda now: {
            "capabilities": 2 | (1 << 13),  # those that it has: MAVLink 2 and parameters as floats
            "flight_sw_version": now.firmware.version,
            "uid": now.uid,
        },
        "FENCE_STATUS": lambda now: {
            "breach_status": int(now.is_breached),
            "breach_count": now.breaches,
            "breach_type": _ALTITUDE_BREACH if now.is_breached else 0,
        },
        "HOME_POSITION": lambda _now: {
            "latitude": LATITUDE_E7,
            "longitude": LONGITUDE_E7,
            "altitude": round(HOME_AMSL_M * 1000.0),
            "q": [1.0, 0.0, 0.0, 0.0],
        },
        "EXTENDED_SYS_STATE": lambda now: {"landed_state": _LANDED_STATES[now.controller.phase]},
    }
)
