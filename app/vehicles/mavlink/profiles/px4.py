"""PX4: its takeoff and landing modes, and the gains of its vertical controllers."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from app.autopilots.dialects import COMMON, Message, number
from app.core.control.px4_parameters import (
    ESTIMATOR_NAMES,
    HOVER_RANGE_NAME,
    LOOP_NAMES,
    UNSUPPORTED,
    hover_deviation,
    hover_limits,
)
from app.core.errors import InputError
from app.vehicles.base import VehicleError
from app.vehicles.mavlink.events import DISARMING, Action, Measurement, Parameter, Setting, VehicleEvent
from app.vehicles.mavlink.profiles import base
from app.vehicles.mavlink.profiles.ardupilot import (
    request_target,
    request_telemetry,
    request_throttle,
    request_version,
)
from app.vehicles.mavlink.profiles.base import GainParameter, Outgoing, Profile, Requirement, Step, Target

TAKE_OFF_ALTITUDE: Final = "MIS_TAKEOFF_ALT"

_HOVER: Final = "MPC_THR_HOVER"
_SET_MODE: Final = 176
_RUN_PREARM_CHECKS: Final = 401
_CUSTOM_MODE: Final = 1.0
_AUTO: Final = 4
_TAKE_OFF: Final = 2
_LOITER: Final = 3
_LAND: Final = 6
_OFFBOARD: Final = 6
_TERMINATION: Final = 10
_INT32: Final = 6
_STREAMED_FOR_S: Final = 1.2
"""It accepts the offboard mode once set points have arrived for a second."""


class Px4(Profile):
    """PX4's profile. Integer parameters are encoded bytewise in a float."""

    name = "px4"
    title = "PX4"
    experiments = ("takeoff-px4", "altitude-steps-px4")
    dialect = COMMON
    autopilot = 12
    lift_off_s = 8.0
    reference = "target"
    flying_modes = frozenset({f"{_AUTO}.{_TAKE_OFF}", f"{_AUTO}.{_LOITER}"})
    following_modes = frozenset({f"{_OFFBOARD}.0"})
    hovering_modes = frozenset({f"{_AUTO}.{_LOITER}"})
    landing_modes = frozenset({f"{_AUTO}.{_LAND}"})
    mode_names = MappingProxyType(
        {
            "1.0": "Manual", "2.0": "Altitude", "3.0": "Position", "4.1": "Ready", "4.2": "Takeoff", "4.3": "Hold",
            "3.1": "Orbit", "3.2": "Position slow", "4.4": "Mission", "4.5": "Return", "4.6": "Land", "5.0": "Acro",
            "6.0": "Offboard", "7.0": "Stabilized", "8.0": "Rattitude", "10.0": "Termination",
            "11.0": "Altitude cruise",
        }
    )  # fmt: skip
    automatic_modes = frozenset(f"{main}.{sub}" for main in (_AUTO, _OFFBOARD, _TERMINATION) for sub in range(256))
    gain_sets = (
        (
            GainParameter("MPC_Z_P", "MPC_Z_P", 0.1, 1.5),
            GainParameter("MPC_Z_VEL_P_ACC", "MPC_Z_VEL_P_ACC", 2.0, 15.0),
            GainParameter("MPC_Z_VEL_I_ACC", "MPC_Z_VEL_I_ACC", 0.2, 3.0, integrates=True),
            GainParameter("MPC_Z_VEL_D_ACC", "MPC_Z_VEL_D_ACC", 0.0, 2.0),
        ),
    )
    requirements = (
        Requirement("NAV_DLL_ACT", "3 (land when the ground station is lost)", frozenset({3.0})),
        Requirement("COM_DL_LOSS_T", "15 s or less (until it lands)", most=15.0),
        Requirement("GF_ACTION", "2 or 5 (hold or land when it leaves its fence)", frozenset({2.0, 5.0})),
        Requirement("GF_MAX_VER_DIST", "10 m or less (altitude of its fence above home)", most=10.0),
    )

    set_point_requirements = (
        Requirement("COM_OF_LOSS_T", "0.5 to 2 s (until it reacts to missing set points)", least=0.5, most=2.0),
        Requirement("COM_OBL_RC_ACT", "4 (land without set points)", frozenset({4.0})),
        Requirement(
            "COM_FAIL_ACT_T", "5 s or less (in which it holds before it lands)", least=0.0, most=5.0, may_lack=True
        ),
    )
    may_lack = frozenset({*UNSUPPORTED, "MPC_VEL_LP", *ESTIMATOR_NAMES, HOVER_RANGE_NAME})
    loop_parameters = (LOOP_NAMES,)

    def hover_limits(self, parameters: Mapping[str, float]) -> tuple[float, float] | None:
        """Return those of its estimator; None if its parameter is not known."""
        told = parameters.get(_HOVER)
        try:
            return None if told is None else hover_limits(told, hover_deviation(parameters))
        except InputError as error:
            raise VehicleError(
                str(error), hint=f"Correct {HOVER_RANGE_NAME} on the vehicle, then try again."
            ) from error

    def measure(self, message: Message) -> Measurement | None:
        return base.read(_READERS, message)

    def prepare(self, target: Target, telemetry_hz: float) -> tuple[Step, ...]:
        return request_telemetry(target, telemetry_hz)

    def prepare_set_points(self, target: Target) -> tuple[Step, ...]:
        return (request_target(target), request_throttle(target))

    def make_armable(self, target: Target, mode: str, *, may_arm: bool | None) -> tuple[Step, ...]:
        """Switch to hold from all other automatic modes: in most it does not arm, and in that of the takeoff it takes
        off as soon as it is armed; and from a pilot's mode in which it reports that it does not arm. It returns to the
        last mode when it disarms, and stays in the landing mode if Land arrives after that."""
        leaves = mode not in self.hovering_modes if mode in self.automatic_modes else may_arm is False
        hold = base.command(target, _SET_MODE, _CUSTOM_MODE, _AUTO, _LOITER)
        return (Step((hold,), awaits="command 176", needed=False),) if leaves else ()

    def take_off_settings(self, target: Target) -> tuple[Setting, ...]:
        return (Setting(TAKE_OFF_ALTITUDE, target.altitude_m),)

    def stream(self, target: Target) -> tuple[Outgoing, ...]:
        return (base.position_target(target),)

    def version_request(self, target: Target) -> Outgoing:
        return request_version(target)

    def checks_request(self, target: Target) -> Outgoing:
        return base.command(target, _RUN_PREARM_CHECKS)

    def steps(self, action: Action, target: Target) -> tuple[Step, ...]:
        match action:
            case Action.ARM:
                return (Step((base.command(target, base.ARM_DISARM, 1.0),), awaits=DISARMING),)
            case Action.TAKE_OFF:
                mode = base.command(target, _SET_MODE, _CUSTOM_MODE, _AUTO, _TAKE_OFF)
                return (Step((mode,), awaits="command 176", attempts=1),)
            case Action.HOLD:
                mode, entered = base.command(target, _SET_MODE, _CUSTOM_MODE, _OFFBOARD), f"mode {_OFFBOARD}.0"
                return (
                    Step((base.position_target(target),), pause_s=_STREAMED_FOR_S),
                    Step((mode,), awaits="command 176", shown_by=entered, persists=True, modes=self.hovering_modes),
                    Step((), awaits=entered),
                    base.follow_target(target),
                )
            case Action.FLY_TO:
                return (base.follow_target(target),)
            case Action.LAND:
                return (Step((base.command(target, _SET_MODE, _CUSTOM_MODE, _AUTO, _LAND),)),)
            case Action.MOTORS_OFF | Action.KILL:
                return (Step((base.disarm(target, forced=action is Action.KILL),)),)


def _parameter(message: Message) -> Parameter:
    parameter = base.parameter(message)
    if number(message, "param_type") != _INT32:
        return parameter
    return replace(parameter, value=base.bytewise_integer(parameter.value))


def _heartbeat(message: Message) -> Measurement | None:
    mode = int(number(message, "custom_mode"))
    return base.heartbeat(message, f"{mode >> 16 & 0xFF}.{mode >> 24 & 0xFF}")


def _event(message: Message) -> VehicleEvent:
    arguments = bytes(getattr(message, "arguments"))  # noqa: B009 - the library has no types
    return VehicleEvent(int(number(message, "id")), int(number(message, "sequence")), arguments)


_READERS: Final[base.Readers] = {
    **base.READERS,
    "HEARTBEAT": _heartbeat,
    "PARAM_VALUE": _parameter,
    "EVENT": _event,
    "ATTITUDE_TARGET": base.commanded_throttle,
    "POSITION_TARGET_LOCAL_NED": base.target_altitude,
}
