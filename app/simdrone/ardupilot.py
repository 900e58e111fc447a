"""Simulated ArduCopter, up to 4.6 and from 4.7 on, in which the vertical gains have other names.

Its altitude controller is a simplified cascade with ArduPilot's gains, not a replica; see copter_control.py.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import ClassVar, Final

from app.simdrone.body import ACCEPTED, FAILED, Body
from app.simdrone.copter import Copter
from app.simdrone.copter_control import ThreeStage
from app.simdrone.copter_parameters import (
    BY_VALUE,
    Behaviour,
    FirmwareProfile,
    FlightMode,
    Kind,
    Parameter,
    Reaction,
    real,
)
from app.vehicles.mavlink.dialects import ARDUPILOTMEGA, Message

_MANUAL: Final = 1 | 16 | 64
_GUIDED: Final = 1 | 8 | 16
_REPORT_ONLY: Final = 0
_ALTITUDE_FENCE: Final = 1

NAMES_4_6: Final[Mapping[str, str]] = MappingProxyType(
    {
        "altitude_p": "PSC_POSZ_P",
        "climb_p": "PSC_VELZ_P",
        "acceleration_p": "PSC_ACCZ_P",
        "acceleration_i": "PSC_ACCZ_I",
        "acceleration_d": "PSC_ACCZ_D",
    }
)
NAMES_4_7: Final[Mapping[str, str]] = MappingProxyType(
    {
        "altitude_p": "PSC_D_POS_P",
        "climb_p": "PSC_D_VEL_P",
        "acceleration_p": "PSC_D_ACC_P",
        "acceleration_i": "PSC_D_ACC_I",
        "acceleration_d": "PSC_D_ACC_D",
    }
)
_DEFAULTS: Final = {
    "altitude_p": 1.0,
    "climb_p": 5.0,
    "acceleration_p": 0.5,
    "acceleration_i": 1.0,
    "acceleration_d": 0.0,
}
SCALE_4_7: Final = 0.1
"""Ratio of the newer acceleration gains to the older ones."""

_COMMON: Final = (
    Parameter("ARMING_CHECK", Kind.INT32, 1),
    Parameter("DISARM_DELAY", Kind.INT8, 10),
    Parameter("FS_EKF_ACTION", Kind.INT8, 1),
    Parameter("FS_GCS_ENABLE", Kind.INT8, 0),
    real("FS_GCS_TIMEOUT", 5.0),
    Parameter("FENCE_ENABLE", Kind.INT8, 0),
    Parameter("FENCE_TYPE", Kind.INT8, 7),
    Parameter("FENCE_ACTION", Kind.INT8, 1),
    real("FENCE_ALT_MAX", 100.0),
    Parameter("LAND_SPEED", Kind.INT16, 50),
    Parameter("WPNAV_SPEED_UP", Kind.INT16, 250),
)


_GROUND_STATION: Final = "SYSID_MYGCS"
_GROUND_STATION_4_7: Final = "MAV_GCS_SYSID"


def _ids(own: str, ground_station: str) -> tuple[Parameter, ...]:
    return Parameter(own, Kind.INT16, 1), Parameter(ground_station, Kind.INT16, 255)


def _gains(names: Mapping[str, str], scale: float) -> tuple[Parameter, ...]:
    scales = {gain: scale if gain.startswith("acceleration") else 1.0 for gain in names}
    return tuple(real(name, _DEFAULTS[gain] * scales[gain]) for gain, name in names.items())


_FIRMWARE: Final = FirmwareProfile(
    dialect=ARDUPILOTMEGA,
    autopilot=3,
    version=0x040600FF,
    parameters=_ids("SYSID_THISMAV", _GROUND_STATION) + _COMMON + _gains(NAMES_4_6, 1.0),
    coding=BY_VALUE,
    periods_s=MappingProxyType({"HEARTBEAT": 1.0}),
    streams=(
        "LOCAL_POSITION_NED",
        "GLOBAL_POSITION_INT",
        "ATTITUDE",
        "VFR_HUD",
        "SYS_STATUS",
        "GPS_RAW_INT",
        "BATTERY_STATUS",
        "SYSTEM_TIME",
    ),
    modes=(
        FlightMode("STABILIZE", 0, _MANUAL),
        FlightMode("ALT_HOLD", 2, _MANUAL),
        FlightMode("GUIDED", 4, _GUIDED),
        FlightMode("LOITER", 5, _GUIDED),
        FlightMode("RTL", 6, _GUIDED, Behaviour.LAND, may_arm=False),
        FlightMode("LAND", 9, _GUIDED, Behaviour.LAND, may_arm=False),
        FlightMode("BRAKE", 17, _GUIDED, may_arm=False),
    ),
    land="LAND",
    hold="BRAKE",
    by_hand="ALT_HOLD",
    automatic="GUIDED",
    refused=FAILED,
    unready="Pre",
    no_estimate="Arm: Need Position Estimate",
    not_armable="Arm: Mode not armable",
    not_landed="Disarm: not landed",
    link_lost="GCS Failsafe",
    fence_breached="Max Alt fence breached",
    ground_m=0.0,
)


class ArduPilot(Copter):
    """ArduCopter up to 4.6. Return-to-launch only lands, because the vehicle does not move horizontally."""

    firmware: ClassVar[FirmwareProfile] = _FIRMWARE
    names: ClassVar[Mapping[str, str]] = NAMES_4_6
    scale: ClassVar[float] = 1.0
    ground_station: ClassVar[str] = _GROUND_STATION

    def __init__(self, body: Body, *, system: int) -> None:
        self._cascade = ThreeStage()
        super().__init__(body, self._cascade, system=system)

    def tune(self) -> None:
        gains = {gain: self.parameters[name] for gain, name in self.names.items()}
        cascade = self._cascade
        cascade.altitude_p, cascade.climb_p = gains["altitude_p"], gains["climb_p"]
        cascade.acceleration_p = gains["acceleration_p"] / self.scale
        cascade.acceleration_i = gains["acceleration_i"] / self.scale
        cascade.acceleration_d = gains["acceleration_d"] / self.scale

    def requested_mode(self, main: int, sub: int) -> FlightMode | None:  # noqa: ARG002  one number suffices
        return next((mode for mode in self.firmware.modes if mode.custom_mode == main), None)

    def take_off(self, param7: float) -> int:
        """Take off to `param7` metres above the place of takeoff; only from the ground, armed and in GUIDED."""
        if self.mode.name != "GUIDED" or not self.armed or self.flyer.flies or not math.isfinite(param7):
            return FAILED
        self.climb(param7, self.parameters["WPNAV_SPEED_UP"] / 100.0)
        return ACCEPTED

    def landing_speed_m_s(self) -> float:
        return self.parameters["LAND_SPEED"] / 100.0

    def link_loss(self) -> tuple[float, Reaction]:
        """Return timeout and reaction: Land for every action of FS_GCS_ENABLE except 0."""
        action = Reaction.LAND if self.parameters["FS_GCS_ENABLE"] else Reaction.NONE
        return self.parameters["FS_GCS_TIMEOUT"], action

    def fence(self) -> tuple[float, Reaction]:
        """Return limit and reaction of the altitude fence: Land for every action except the report."""
        is_on = self.parameters["FENCE_ENABLE"] and int(self.parameters["FENCE_TYPE"]) & _ALTITUDE_FENCE
        if not is_on:
            return math.inf, Reaction.NONE
        reports = self.parameters["FENCE_ACTION"] == _REPORT_ONLY
        return self.parameters["FENCE_ALT_MAX"], Reaction.WARN if reports else Reaction.LAND

    def idle_limit_s(self) -> float:
        return self.parameters["DISARM_DELAY"]

    def counts_heartbeat(self, message: Message) -> bool:
        """Count only heartbeats of its own ground station."""
        return message.get_srcSystem() == self.parameters[self.ground_station]


class ArduPilot47(ArduPilot):
    """ArduCopter from 4.7 on: other names, and acceleration gains of a tenth."""

    firmware: ClassVar[FirmwareProfile] = replace(
        _FIRMWARE,
        version=0x040700FF,
        parameters=_ids("MAV_SYSID", _GROUND_STATION_4_7) + _COMMON + _gains(NAMES_4_7, SCALE_4_7),
    )
    names: ClassVar[Mapping[str, str]] = NAMES_4_7
    scale: ClassVar[float] = SCALE_4_7
    ground_station: ClassVar[str] = _GROUND_STATION_4_7
