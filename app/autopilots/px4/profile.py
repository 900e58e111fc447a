"""PX4: its takeoff and landing modes, and the gains of its vertical controllers."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from app.autopilots import commands, mavlink
from app.autopilots.autopilot import Autopilot, AutopilotError, ChecksRequest, HoverLimits, Requirement, on_board
from app.autopilots.commands import Action, Step, Target
from app.autopilots.dialects import COMMON, Message, number
from app.autopilots.measurements import Measurement, Parameter, VehicleEvent
from app.autopilots.px4.arming_checks import HEALTH_SUMMARY, Px4ArmingChecks
from app.autopilots.px4.experiments import EXPERIMENTS, GAINS
from app.autopilots.px4.parameter_file import PARAMETER_FILE
from app.autopilots.px4.replica.hover_range import HOVER_RANGE_NAME, HOVER_THRUSTS, hover_deviation, hover_limits
from app.autopilots.px4.replica.parameters import ESTIMATOR_NAMES, LOOP_NAMES, THRUST_GAINS, UNSUPPORTED
from app.core.errors import InputError

_HOVER: Final = "MPC_THR_HOVER"
_RUN_PREARM_CHECKS: Final = 401
_AUTO: Final = 4
_TAKE_OFF: Final = 2
_LOITER: Final = 3
_LAND: Final = 6
_OFFBOARD: Final = 6
_TERMINATION: Final = 10
_HOVERING_MODES: Final = frozenset({f"{_AUTO}.{_LOITER}"})
_MODE_NAMES: Final = MappingProxyType(
    {
        "1.0": "Manual", "2.0": "Altitude", "3.0": "Position", "4.1": "Ready", "4.2": "Takeoff", "4.3": "Hold",
        "3.1": "Orbit", "3.2": "Position slow", "4.4": "Mission", "4.5": "Return", "4.6": "Land", "5.0": "Acro",
        "6.0": "Offboard", "7.0": "Stabilized", "8.0": "Rattitude", "10.0": "Termination",
        "11.0": "Altitude cruise",
    }
)  # fmt: skip
_INT32: Final = 6
_FURTHER_GAINS: Final = (
    *THRUST_GAINS.values(),
    "MPC_XY_P",
    *(f"MPC_XY_VEL_{term}{form}" for form in ("_ACC", "") for term in "PID"),
    *(f"MC_{axis}_P" for axis in ("ROLL", "PITCH", "YAW")),
    *(f"MC_{axis}RATE_{term}" for axis in ("ROLL", "PITCH", "YAW") for term in ("K", "P", "I", "D", "FF")),
)
_SELF_WRITTEN: Final = r"COM_FLIGHT_UUID|LND_FLIGHT_T_(HI|LO)|CAL_GYRO\d_[XYZ]OFF|CAL_MAG\d_[XYZ]OFF|EKF2_MAGBIAS_[XYZ]"
"""Number and time of its flights, what it measures on the ground, and what it estimates in flight."""
_STREAMED_FOR_S: Final = 1.2
"""It accepts the offboard mode once set points have arrived for a second."""


def _hover_limits(parameters: Mapping[str, float]) -> HoverLimits | None:
    """Return those of its estimator; None if its parameter is not known."""
    if _HOVER not in parameters:
        return None
    try:
        low, high = hover_limits(parameters[_HOVER], hover_deviation(parameters))
    except InputError as error:
        raise AutopilotError(str(error), hint=f"Correct {HOVER_RANGE_NAME} on the vehicle, then try again.") from error
    words = f"within {_HOVER} ± {HOVER_RANGE_NAME}, {low:.2f} … {high:.2f}: PX4's estimate stops there"
    return HoverLimits(low, high, words, _HOVER, HOVER_THRUSTS[1])


def _steps(action: Action, target: Target) -> tuple[Step, ...]:
    match action:
        case Action.TAKE_OFF:
            return (Step((commands.set_mode(target, _AUTO, _TAKE_OFF),), awaits="command 176", attempts=1),)
        case Action.HOLD:
            mode, entered = commands.set_mode(target, _OFFBOARD), f"mode {_OFFBOARD}.0"
            return (
                Step((commands.position_target(target),), pause_s=_STREAMED_FOR_S),
                Step((mode,), awaits="command 176", shown_by=entered, persists=True, modes=_HOVERING_MODES),
                Step((), awaits=entered),
                commands.follow_target(target),
            )
        case _:
            return commands.copter_steps(action, target, _AUTO, _LAND)


def _parameter(message: Message) -> Parameter:
    parameter = mavlink.parameter(message)
    if number(message, "param_type") != _INT32:
        return parameter
    return replace(parameter, value=mavlink.bytewise_integer(parameter.value))


def _heartbeat(message: Message) -> Measurement | None:
    mode = int(number(message, "custom_mode"))
    return mavlink.heartbeat(message, f"{mode >> 16 & 0xFF}.{mode >> 24 & 0xFF}")


def _event(message: Message) -> VehicleEvent:
    arguments = bytes(getattr(message, "arguments"))  # noqa: B009 - the library has no types
    return VehicleEvent(int(number(message, "id")), int(number(message, "sequence")), arguments)


PX4: Final = Autopilot(
    name="px4",
    title="PX4",
    experiments=EXPERIMENTS,
    dialect=COMMON,
    autopilot=12,
    label="PX4",
    lift_off_s=8.0,
    reference="target",
    flying_modes=frozenset({f"{_AUTO}.{_TAKE_OFF}"}) | _HOVERING_MODES,
    following_modes=frozenset({f"{_OFFBOARD}.0"}),
    hovering_modes=_HOVERING_MODES,
    landing_modes=frozenset({f"{_AUTO}.{_LAND}"}),
    automatic_modes=frozenset(f"{main}.{sub}" for main in (_AUTO, _OFFBOARD, _TERMINATION) for sub in range(256)),
    mode_names=_MODE_NAMES,
    gain_sets=(on_board(GAINS, integrating="MPC_Z_VEL_I_ACC"),),
    sends_integers_bytewise=True,
    loop_parameters=(LOOP_NAMES,),
    parameter_file=PARAMETER_FILE,
    further_gains=_FURTHER_GAINS,
    self_written=_SELF_WRITTEN,
    may_lack=frozenset({*UNSUPPORTED, "MPC_VEL_LP", *ESTIMATOR_NAMES, HOVER_RANGE_NAME}),
    hover_limits=_hover_limits,
    requirements=(
        Requirement("NAV_DLL_ACT", "3 (land when the ground station is lost)", frozenset({3.0})),
        Requirement("COM_DL_LOSS_T", "15 s or less (until it lands)", most=15.0),
        Requirement("GF_ACTION", "2 or 5 (hold or land when it leaves its fence)", frozenset({2.0, 5.0})),
        Requirement("GF_MAX_VER_DIST", "10 m or less (altitude of its fence above home)", most=10.0),
    ),
    set_point_requirements=(
        Requirement("COM_OF_LOSS_T", "0.5 to 2 s (until it reacts to missing set points)", least=0.5, most=2.0),
        Requirement("COM_OBL_RC_ACT", "4 (land without set points)", frozenset({4.0})),
        Requirement(
            "COM_FAIL_ACT_T", "5 s or less (in which it holds before it lands)", least=0.0, most=5.0, may_lack=True
        ),
    ),
    takeoff_parameter="MIS_TAKEOFF_ALT",
    readers={
        **mavlink.READERS,
        "HEARTBEAT": _heartbeat,
        "PARAM_VALUE": _parameter,
        "EVENT": _event,
        "ATTITUDE_TARGET": mavlink.commanded_throttle,
        "POSITION_TARGET_LOCAL_NED": mavlink.target_altitude,
    },
    telemetry=commands.COPTER_TELEMETRY,
    set_point_telemetry=(commands.FOLLOWED_TARGET, commands.DEMANDED_THROTTLE),
    arming_checks=Px4ArmingChecks,
    checks=ChecksRequest(_RUN_PREARM_CHECKS, last=HEALTH_SUMMARY),
    steps=_steps,
    needs_stream=True,
    armable_mode=(_AUTO, _LOITER),
)
"""Integer parameters are encoded bytewise in a float. In most automatic modes it does not arm, and in that of the
takeoff it takes off as soon as it is armed. It returns to the last mode when it disarms, and stays in the landing mode
if Land arrives after that."""
