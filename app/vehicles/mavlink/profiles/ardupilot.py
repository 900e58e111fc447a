"""ArduCopter: guided mode, and its vertical controllers' gains by the names before and since release 4.7."""

from types import MappingProxyType
from typing import Final

from app.autopilots.dialects import ARDUPILOTMEGA, GROUND_STATION, Message, number
from app.core.control.ardupilot_parameters import LOOP_NAMES, NEWER_NAMES, UNSUPPORTED
from app.vehicles.mavlink.events import DISARMING, Action, Measurement, Setting
from app.vehicles.mavlink.profiles import base
from app.vehicles.mavlink.profiles.base import GainParameter, Outgoing, Profile, Requirement, Step, Target

GUIDED: Final = 4
LAND: Final = 9

_SET_MODE: Final = 176
_TAKE_OFF: Final = 22
_SET_MESSAGE_INTERVAL: Final = 511
_REQUEST_MESSAGE: Final = 512
_SYS_STATUS: Final = 1
_ATTITUDE: Final = 30
_LOCAL_POSITION_NED: Final = 32
_NAV_CONTROLLER_OUTPUT: Final = 62
_VFR_HUD: Final = 74
_ATTITUDE_TARGET: Final = 83
_POSITION_TARGET_LOCAL_NED: Final = 85
_FENCE_STATUS: Final = 162
_EXTENDED_SYS_STATE: Final = 245
_STATUS_HZ: Final = 4.0
_ATTITUDE_HZ: Final = 10.0
_THROTTLE_HZ: Final = 10.0
REFERENCE_HZ: Final = 50.0
"""Rate of what is compared with the altitude, sample by sample."""
_AUTOPILOT_VERSION: Final = 148
_CUSTOM_MODE: Final = 1.0
_RENAMED: Final = frozenset(older for older, _ in NEWER_NAMES.values())
_LATER: Final = frozenset({*UNSUPPORTED, "PSC_ACCZ_D_FF", "TKOFF_SLEW_TIME", "TKOFF_THR_MAX"})
"""Parameters that were added after the first releases with these gains."""
_MAY_LACK: Final = _LATER | {
    newer for newer, (older, _) in NEWER_NAMES.items() if older in _LATER or older == "PSC_JERK_Z"
}
"""Releases have one of two names for PSC_JERK_Z."""


class ArduPilot(Profile):
    """Gains have the names before 4.7; on vehicles with the new names, some of the values are a tenth. It does not arm
    without an integral gain of the acceleration."""

    name = "ardupilot"
    title = "ArduCopter"
    experiments = ("takeoff-ardupilot", "altitude-steps-ardupilot")
    dialect = ARDUPILOTMEGA
    autopilot = 3
    lift_off_s = 6.0
    reference = "error"
    flying_modes = frozenset({str(GUIDED)})
    following_modes = frozenset({str(GUIDED)})
    landing_modes = frozenset({str(LAND)})
    mode_names = MappingProxyType(
        {
            "0": "Stabilize", "1": "Acro", "2": "AltHold", "3": "Auto", "4": "Guided", "5": "Loiter", "6": "RTL",
            "7": "Circle", "9": "Land", "11": "Drift", "13": "Sport", "14": "Flip", "15": "AutoTune", "16": "PosHold",
            "17": "Brake", "18": "Throw", "19": "Avoid_ADSB", "20": "Guided_NoGPS", "21": "SmartRTL", "22": "FlowHold",
            "23": "Follow", "24": "ZigZag", "25": "SystemID", "26": "Autorotate", "27": "Auto RTL", "28": "Turtle",
        }
    )  # fmt: skip
    automatic_modes = frozenset({"3", "4", "6", "9", "17", "19", "20", "21", "23", "26", "27"})
    gain_sets = (
        (
            GainParameter("PSC_POSZ_P", "PSC_POSZ_P", 0.1, 4.0),
            GainParameter("PSC_VELZ_P", "PSC_VELZ_P", 0.5, 10.0),
            GainParameter("PSC_ACCZ_P", "PSC_ACCZ_P", 0.05, 2.0),
            GainParameter("PSC_ACCZ_I", "PSC_ACCZ_I", 0.2, 4.0, integrates=True),
            GainParameter("PSC_ACCZ_D", "PSC_ACCZ_D", 0.0, 0.4),
        ),
        (
            GainParameter("PSC_POSZ_P", "PSC_D_POS_P", 0.1, 4.0),
            GainParameter("PSC_VELZ_P", "PSC_D_VEL_P", 0.5, 10.0),
            GainParameter("PSC_ACCZ_P", "PSC_D_ACC_P", 0.05, 2.0, factor=0.1),
            GainParameter("PSC_ACCZ_I", "PSC_D_ACC_I", 0.2, 4.0, factor=0.1, integrates=True),
            GainParameter("PSC_ACCZ_D", "PSC_D_ACC_D", 0.0, 0.4, factor=0.1),
        ),
    )
    requirements = (
        Requirement("FS_GCS_ENABLE", "5 (land when the ground station is lost)", frozenset({5.0})),
        Requirement("FS_GCS_TIMEOUT", "15 s or less (until it lands)", most=15.0),
        Requirement(
            "SYSID_MYGCS",
            f"{GROUND_STATION} (Gainline as its ground station)",
            frozenset({float(GROUND_STATION)}),
            newer_name="MAV_GCS_SYSID",
        ),
        Requirement("FENCE_ENABLE", "1 (stay inside its fence)"),
        Requirement("FENCE_TYPE", "bit 0 set (a fence for altitude)", bits=1),
        Requirement("FENCE_ACTION", "2 or 4 (land or brake at its fence)", frozenset({2.0, 4.0})),
        Requirement("FENCE_ALT_MAX", "10 m or less (altitude of its fence)", most=10.0),
        Requirement("FS_EKF_ACTION", "1 or 3 (land when its position is lost)", frozenset({1.0, 3.0})),
    )

    set_point_requirements = (
        Requirement("GUID_OPTIONS", "without bit 6 (targets flown by the position controller)", clear_bits=1 << 6),
    )
    may_lack = _MAY_LACK
    loop_parameters = (LOOP_NAMES, (*(name for name in LOOP_NAMES if name not in _RENAMED), *NEWER_NAMES))

    def measure(self, message: Message) -> Measurement | None:
        return base.read(_READERS, message)

    def prepare(self, target: Target, telemetry_hz: float) -> tuple[Step, ...]:
        """Request telemetry: without requests, only heartbeats are sent on a direct link."""
        return request_telemetry(target, telemetry_hz)

    def prepare_set_points(self, target: Target) -> tuple[Step, ...]:
        return (
            _request(target, _NAV_CONTROLLER_OUTPUT, REFERENCE_HZ),
            request_target(target),
            request_throttle(target),
        )

    def set_point_settings(self, target: Target) -> tuple[Setting, ...]:  # noqa: ARG002 - the same for all
        """Return that the hover throttle is not learned: the gains are compared with one and the same."""
        return (Setting("MOT_HOVER_LEARN", 0.0),)

    def version_request(self, target: Target) -> Outgoing:
        return request_version(target)

    def steps(self, action: Action, target: Target) -> tuple[Step, ...]:
        match action:
            case Action.ARM:
                return (
                    Step((base.command(target, _SET_MODE, _CUSTOM_MODE, GUIDED),), awaits="command 176"),
                    Step((base.command(target, base.ARM_DISARM, 1.0),), awaits=DISARMING),
                )
            case Action.TAKE_OFF:
                above = base.command(target, _TAKE_OFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, target.altitude_m)
                return (Step((above,), awaits="command 22", attempts=1),)
            case Action.HOLD | Action.FLY_TO:
                return (base.follow_target(target),)
            case Action.LAND:
                return (Step((base.command(target, _SET_MODE, _CUSTOM_MODE, LAND),)),)
            case Action.MOTORS_OFF:
                return (Step((base.disarm(target),)),)
            case Action.KILL:
                return (Step((base.disarm(target, forced=True),)),)


def request_telemetry(target: Target, telemetry_hz: float) -> tuple[Step, ...]:
    """Request all messages that a trial uses, positions at this rate. Not every autopilot sends the last four."""
    return (
        _request(target, _LOCAL_POSITION_NED, telemetry_hz),
        _request(target, _SYS_STATUS, _STATUS_HZ),
        _request(target, _EXTENDED_SYS_STATE, _STATUS_HZ, needed=False),
        _request(target, _FENCE_STATUS, _STATUS_HZ, needed=False),
        _request(target, _VFR_HUD, _THROTTLE_HZ, needed=False),
        _request(target, _ATTITUDE, _ATTITUDE_HZ, needed=False),
    )


def request_target(target: Target) -> Step:
    """Return the request for the position target that it follows."""
    return _request(target, _POSITION_TARGET_LOCAL_NED, REFERENCE_HZ)


def request_throttle(target: Target) -> Step:
    """Return the request for the throttle that its loop demands."""
    return _request(target, _ATTITUDE_TARGET, REFERENCE_HZ)


def _request(target: Target, message: int, rate_hz: float, *, needed: bool = True) -> Step:
    request = base.command(target, _SET_MESSAGE_INTERVAL, message, round(1e6 / rate_hz))
    return Step((request,), awaits="command 511", attempts=5 if needed else 2, needed=needed)


def request_version(target: Target) -> Outgoing:
    """Return a request for one AUTOPILOT_VERSION."""
    return base.command(target, _REQUEST_MESSAGE, _AUTOPILOT_VERSION)


def _heartbeat(message: Message) -> Measurement | None:
    return base.heartbeat(message, f"{number(message, 'custom_mode'):.0f}")


_READERS: Final[base.Readers] = {
    **base.READERS,
    "HEARTBEAT": _heartbeat,
    "NAV_CONTROLLER_OUTPUT": base.altitude_error,
    "POSITION_TARGET_LOCAL_NED": base.target_altitude,
    "ATTITUDE_TARGET": base.commanded_throttle,
}
