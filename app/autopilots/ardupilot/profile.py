"""ArduCopter: guided mode, and its vertical controllers' gains by the names before and since release 4.7."""

from types import MappingProxyType
from typing import Final

from app.autopilots import commands, mavlink
from app.autopilots.ardupilot.experiments import EXPERIMENTS, GAINS
from app.autopilots.ardupilot.replica.parameters import LOOP_NAMES, NEWER_NAMES, SINCE_4_7, UNSUPPORTED, in_names_of
from app.autopilots.autopilot import Autopilot, Requirement, on_board
from app.autopilots.commands import Action, Setting, Step, Target
from app.autopilots.dialects import ARDUPILOTMEGA, GROUND_STATION, number
from app.autopilots.measurements import AltitudeError

GUIDED: Final = 4
LAND: Final = 9

_TAKE_OFF: Final = 22
_MODE_NAMES: Final = MappingProxyType(
    {
        "0": "Stabilize", "1": "Acro", "2": "AltHold", "3": "Auto", "4": "Guided", "5": "Loiter", "6": "RTL",
        "7": "Circle", "9": "Land", "11": "Drift", "13": "Sport", "14": "Flip", "15": "AutoTune", "16": "PosHold",
        "17": "Brake", "18": "Throw", "19": "Avoid_ADSB", "20": "Guided_NoGPS", "21": "SmartRTL", "22": "FlowHold",
        "23": "Follow", "24": "ZigZag", "25": "SystemID", "26": "Autorotate", "27": "Auto RTL", "28": "Turtle",
    }
)  # fmt: skip
_TERMS: Final = ("P", "I", "D", "FF", "D_FF")
_AXES: Final = ("RLL", "PIT", "YAW")
_FURTHER_GAINS: Final = (
    *("PSC_POSXY_P", "PSC_NE_POS_P"),
    *(f"PSC_{loop}_{term}" for loop in ("VELXY", "NE_VEL", "VELZ", "D_VEL", "ACCZ", "D_ACC") for term in _TERMS),
    *(f"ATC_ANG_{axis}_P" for axis in _AXES),
    *(f"ATC_RAT_{axis}_{term}" for axis in _AXES for term in _TERMS),
)
_SELF_WRITTEN: Final = (
    r"STAT_\w+|(MIS|FENCE|RALLY)_TOTAL|COMPASS_DEC"
    r"|(BARO\d*|GND)_(GND_PRESS|ABS_PRESS|TEMP)|INS_GYR\d?_?OFFS_[XYZ]|INS_GYR\d?_CALTEMP"
)
"""Times of flight and boots, counts of what was loaded, what follows from the position; measured at every start."""
_INTEGRATING: Final = "PSC_ACCZ_I"
_LATER: Final = frozenset({*UNSUPPORTED, "PSC_ACCZ_D_FF", "TKOFF_SLEW_TIME", "TKOFF_THR_MAX"})
"""Parameters that were added after the first releases with these gains."""
_MAY_LACK: Final = _LATER | {
    newer for newer, (older, _) in NEWER_NAMES.items() if older in _LATER or older == "PSC_JERK_Z"
}
"""Releases have one of two names for PSC_JERK_Z."""


def _steps(action: Action, target: Target) -> tuple[Step, ...]:
    if action is Action.TAKE_OFF:
        above = commands.command(target, _TAKE_OFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, target.altitude_m)
        return (Step((above,), awaits="command 22", attempts=1),)
    steps = commands.copter_steps(action, target, LAND)
    guided = Step((commands.set_mode(target, GUIDED),), awaits="command 176")
    return (guided, *steps) if action is Action.ARM else steps


ARDUPILOT: Final = Autopilot(
    name="ardupilot",
    title="ArduCopter",
    project="ArduPilot",
    experiments=EXPERIMENTS,
    dialect=ARDUPILOTMEGA,
    autopilot=3,
    label="ArduCopter",
    lift_off_s=6.0,
    reference="error",
    flying_modes=frozenset({str(GUIDED)}),
    following_modes=frozenset({str(GUIDED)}),
    landing_modes=frozenset({str(LAND)}),
    automatic_modes=frozenset({"3", "4", "6", "9", "17", "19", "20", "21", "23", "26", "27"}),
    mode_names=_MODE_NAMES,
    gain_sets=(
        on_board(GAINS, integrating=_INTEGRATING),
        on_board(GAINS, integrating=_INTEGRATING, names=SINCE_4_7),
    ),
    loop_parameters=(LOOP_NAMES, (*(name for name in LOOP_NAMES if name not in SINCE_4_7), *NEWER_NAMES)),
    further_gains=_FURTHER_GAINS,
    self_written=_SELF_WRITTEN,
    in_names_of=in_names_of,
    may_lack=_MAY_LACK,
    requirements=(
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
    ),
    set_point_requirements=(
        Requirement("GUID_OPTIONS", "without bit 6 (targets flown by the position controller)", clear_bits=1 << 6),
    ),
    set_point_settings=(Setting("MOT_HOVER_LEARN", 0.0),),
    readers={
        **mavlink.READERS,
        "HEARTBEAT": lambda message: mavlink.heartbeat(message, f"{number(message, 'custom_mode'):.0f}"),
        "NAV_CONTROLLER_OUTPUT": lambda message: AltitudeError(number(message, "alt_error")),
        "POSITION_TARGET_LOCAL_NED": mavlink.target_altitude,
        "ATTITUDE_TARGET": mavlink.commanded_throttle,
    },
    telemetry=commands.COPTER_TELEMETRY,
    set_point_telemetry=(commands.ALTITUDE_ERROR, commands.FOLLOWED_TARGET, commands.DEMANDED_THROTTLE),
    steps=_steps,
)
"""Gains have the names before 4.7; on vehicles with the new names, some of the values are a tenth. It does not arm
without an integral gain of the acceleration. The hover throttle is not learned in flights with several set points: the
gains are compared with one and the same."""
