"""Telemetry of Paparazzi: its estimates, its messages, their periods and their peculiarities."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from app.autopilots.dialects import PAPARAZZI
from app.autopilots.simulated.body import (
    ARMED,
    Body,
    Fields,
    SimulatedAutopilot,
    timed,
    whole_ticks,
)
from app.autopilots.simulated.copter_parameters import Parameters, read_periods
from app.core.control.vertical_guidance import POSITION_BITS, SPEED_BITS, fix

PERIODS_S: Final = read_periods(Path(__file__).parent / "simulated_periods.csv")
"""Periods with a telemetry file for tuning."""

BARE_POSITION_PERIOD_S: Final = 0.8
"""Period without such a file."""

_LATITUDE_E7: Final = 435641193
_LONGITUDE_E7: Final = 14812804
GROUND_MM: Final = 147_095
"""Altitude of the place, and of the origin that the flight plan sets there."""
PLAN_ORIGIN_MM: Final = 146_000
"""Altitude of the flight plan's own origin, which holds before: over a metre below the ground, so that a takeoff to a
height in the local frame is shorter. In JSBSim one with the first gains scores 0.273 m in place of 0.323; two flights
of the real one without "Geo init" scored 0.272 and 0.283 m in place of 0.325."""
GROUND_COUNTS: Final = 25
"""Height of the vehicle on the ground above the local origin that "Geo init" sets, 1/256 m (0.098 m)."""
_GEOID_MM: Final = 49817

# modes
KILL: Final = 0
FAILSAFE: Final = 1
HOME: Final = 2
BY_HAND: Final = 12
NAV: Final = 13
GUIDED: Final = 19

_NO_TEMPERATURE: Final = 32767
_NOISE_M_S: Final = 1.0 / (1 << SPEED_BITS)
_NOISE_MS: Final = 20
"""An estimate is never the same twice."""

FALLS_M_S: Final = -2.0
FIX_TICKS: Final = whole_ticks(0.098)
"""Interval of the position fixes."""
_STEP_S: Final = 0.08
"""Step of a fix as the time in which it falls as far."""
_KEPT: Final = 0.75
"""Share of the error in altitude that is left by a fix after the impact."""
_SLOWED_M_S: Final = 0.7
"""Reduction of the estimated speed by a fix after the impact."""


class FallEstimator:
    """Errors of the estimates of altitude and climb rate, which are true in flight and wrong in a fall, to be updated
    with every fix: `error_m` is added to the true altitude.

    In a recorded fall from 3.3 m with stopped motors its position fixes, ten a second, moved the estimated altitude by
    −0.11, −0.30, −0.45 and −0.52 m, at −2.4, −3.7, −5.0 and −6.8 m/s. After the impact the estimate went on to 1.2 m
    below the ground, and took 1.2 s to come back.
    """

    def __init__(self) -> None:
        self.error_m = 0.0
        self._sinks_m_s = 0.0

    def fix(self, altitude_m: float, climb_rate_m_s: float, *, is_driven: bool) -> None:
        """Process a position fix of a vehicle at this true altitude above the ground; `is_driven`: its motors turn."""
        if climb_rate_m_s < FALLS_M_S and not is_driven:
            self.error_m += _STEP_S * climb_rate_m_s if altitude_m + self.error_m > 0.0 else 0.0
            self._sinks_m_s = climb_rate_m_s
        else:
            self.error_m *= _KEPT
            self._sinks_m_s = min(self._sinks_m_s + _SLOWED_M_S, 0.0)

    def climb_rate_m_s(self, true_m_s: float) -> float:
        """Return the estimated climb rate."""
        return min(true_m_s, self._sinks_m_s) if self._sinks_m_s else true_m_s


class ReportingPaparazzi(SimulatedAutopilot):
    """What the reports of a Paparazzi are of: its state, beside its body. Heights in its local frame, up. `sends_mode`:
    its heartbeat contains the mode's number."""

    component = 190
    list_ticks = whole_ticks(0.2)

    def __init__(self, body: Body, parameters: Parameters, *, system: int, sends_mode: bool) -> None:
        super().__init__(body, PAPARAZZI, parameters, PERIODS_S, system=system)
        self.sends_mode = sends_mode
        self.origin_mm = PLAN_ORIGIN_MM
        self.estimator = FallEstimator()
        self._home_m = 0.0

    @property
    def mode(self) -> int:
        return int(self.parameters["aut_mod"])

    @property
    def ground_counts(self) -> int:
        """Height of the standing vehicle, 1/256 m."""
        return GROUND_COUNTS + fix((GROUND_MM - self.origin_mm) / 1000.0, POSITION_BITS)

    @property
    def height_m(self) -> float:
        return self.body.altitude_m + self.ground_counts / (1 << POSITION_BITS)

    @property
    def estimated_m(self) -> float:
        """Its estimate of its height."""
        return self.height_m + self.estimator.error_m

    @property
    def climb_rate_m_s(self) -> float:
        """Its estimate of its climb rate."""
        return self.estimator.climb_rate_m_s(self.body.climb_rate_m_s)

    @property
    def north_m(self) -> float:
        """Position in the local frame, whose origin is HOME."""
        return self.body.north_m - self._home_m

    @property
    def battery_mv(self) -> int:
        """Voltage in mV, in steps of 0.1 V."""
        return math.floor(self.body.battery_v * 10.0) * 100

    def refer_to_ground(self) -> None:
        """Move the local origin to the present place."""
        self.origin_mm = GROUND_MM + round(self.body.altitude_m * 1000.0)
        self._home_m = self.body.north_m


def heartbeat(now: ReportingPaparazzi) -> Fields:
    """Return HEARTBEAT; NAV and HOME are equal in it unless it contains the mode's number."""
    mode = {KILL: 0, FAILSAFE: 0, GUIDED: 8, BY_HAND: 64 | 16}.get(now.mode, 4)
    return {
        "type": 2,
        "autopilot": 9,
        "base_mode": mode | (ARMED if now.armed else 0),
        "custom_mode": now.mode if now.sends_mode else 0,
        "system_status": 4 if now.armed else 3,
        "mavlink_version": 3,
    }


def global_position(now: ReportingPaparazzi) -> Fields:
    """Return GLOBAL_POSITION_INT; as in the real one, `relative_alt` is altitude in mm minus the origin in m."""
    altitude_mm = now.origin_mm + _GEOID_MM + round(now.estimated_m * 1000.0)
    return {
        "time_boot_ms": now.boot_ms,
        "lat": _LATITUDE_E7,
        "lon": _LONGITUDE_E7,
        "alt": altitude_mm,
        "relative_alt": altitude_mm - now.origin_mm // 1000 - 1,
        "vz": round(-now.climb_rate_m_s * 100.0),
        "hdg": 33,
    }


MESSAGES: Final[Mapping[str, Callable[[ReportingPaparazzi], Fields]]] = MappingProxyType(
    {
        "LOCAL_POSITION_NED": lambda now: {
            "time_boot_ms": now.boot_ms,
            "x": _stepped(now.north_m, POSITION_BITS),
            "z": -_stepped(now.estimated_m, POSITION_BITS),
            "vx": _stepped(now.body.north_m_s, SPEED_BITS),
            "vz": -_stepped(now.climb_rate_m_s, SPEED_BITS) - _NOISE_M_S * (now.boot_ms // _NOISE_MS % 2),
        },
        "HEARTBEAT": heartbeat,
        "ATTITUDE": timed,
        "GLOBAL_POSITION_INT": global_position,
        "SYS_STATUS": lambda now: {
            "onboard_control_sensors_present": 15,
            "onboard_control_sensors_enabled": 15,
            "onboard_control_sensors_health": 15,
            "load": 65535,
            "voltage_battery": now.battery_mv,
            "current_battery": _current(now),
            "battery_remaining": -1,
        },
        "VFR_HUD": lambda now: {
            "throttle": round(now.body.thrust * 100.0),
            "alt": (now.origin_mm + _GEOID_MM) / 1000.0 + now.estimated_m,
            "climb": -now.climb_rate_m_s,  # positive downwards, as in the real one
        },
        "ATTITUDE_QUATERNION": lambda now: {**timed(now), "q1": 1.0},
        "SYSTEM_TIME": timed,
        "BATTERY_STATUS": lambda now: {
            "temperature": _NO_TEMPERATURE,
            "voltages": [now.battery_mv, *[0] * 9],
            "current_battery": _current(now),
            "battery_remaining": -1,
        },
        "GPS_GLOBAL_ORIGIN": lambda now: {
            "latitude": _LATITUDE_E7,
            "longitude": _LONGITUDE_E7,
            "altitude": now.origin_mm,
        },
        "AUTOPILOT_VERSION": lambda _now: {"flight_sw_version": 51000},
    }
)


def _stepped(value: float, bits: int) -> float:
    """Return the value in steps of the autopilot's integers."""
    return round(value * (1 << bits)) / (1 << bits)


def _current(now: ReportingPaparazzi) -> int:
    """Return the current in 10 mA: that at hover in the recorded flights, proportional to thrust."""
    return round(443 * now.body.thrust / 0.63)
