"""What an analysis of steps needs of a telemetry log of ArduCopter, and of PX4."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.log import MODES
from app.autopilots.ardupilot.replica import parameters as ardupilot_parameters
from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.px4.replica import parameters as px4_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class CopterAutopilot:
    """What differs between the two.

    `number_of_mode` is of the custom mode in a heartbeat; `mode` is the one whose set points the vehicle reports.
    `messages` are needed. Of the parameters, the gains in `bounds` are needed, and `learned` if there is one, which the
    vehicle changes by itself; `kept` are all on which the loop depends, `usual` those that every release has.
    `shapes_reference` if the reference is not the set point itself. `hint` says what to record.
    """

    number_of_mode: Callable[[int], int]
    mode: int
    modes: Mapping[float, str]
    messages: Sequence[str]
    bounds: Mapping[str, tuple[float, float]]
    kept: Sequence[str]
    usual: Sequence[str]
    learned: str
    shapes_reference: bool
    hint: str

    def mode_name(self, mode: int) -> str:
        """As its users call it."""
        return self.modes.get(mode, f"mode {mode}")


_ASK: Final = (
    "Use a telemetry log of altitude steps in {mode}: hover for 5 s, climb 2 m, hover for 5 s, descend 2 m, hover for "
    "5 s. Before it read all parameters, and ask the vehicle for 50 of each of these messages a second: "
    "MAV_CMD_SET_MESSAGE_INTERVAL with 20000 µs for {messages}{or_else}. The vehicle's own log ({own}) needs none of "
    "this."
)
IN_TAKEOFFS: Final = frozenset(
    {"TKOFF_SLEW_TIME", "TKOFF_THR_MAX", "MPC_TKO_RAMP_T", "COM_SPOOLUP_TIME", "MPC_LAND_SPEED"}
)
"""Parameters that act in takeoffs and landings alone."""


AUTOPILOTS: Final[Mapping[str, CopterAutopilot]] = MappingProxyType(
    {
        "ardupilot": CopterAutopilot(
            number_of_mode=lambda mode: mode,
            mode=4,
            modes=MODES,
            messages=("LOCAL_POSITION_NED", "NAV_CONTROLLER_OUTPUT", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"),
            bounds=ArduPilotLoop.space.bounds,
            learned="MOT_THST_HOVER",
            kept=ardupilot_parameters.LOOP_NAMES,
            usual=(
                *ardupilot_parameters.DEFAULTS,
                ardupilot_parameters.ACCELEROMETER_FILTER,
                ardupilot_parameters.LOOP_RATE,
            ),
            shapes_reference=True,
            hint=_ASK.format(
                mode="GUIDED",
                messages="32, 62, 83 and 85",
                or_else=" (in MAVProxy: long SET_MESSAGE_INTERVAL 32 20000)",
                own=".bin",
            ),
        ),
        "px4": CopterAutopilot(
            number_of_mode=lambda mode: mode >> 16 & 0xFF,
            mode=6,
            modes=MappingProxyType({1: "Manual", 2: "Altitude", 3: "Position", 4: "Automatic", 6: "Offboard"}),
            messages=("LOCAL_POSITION_NED", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"),
            bounds=Px4Loop.space.bounds,
            learned="",
            kept=px4_parameters.LOOP_NAMES,
            usual=(*px4_parameters.DEFAULTS, *px4_parameters.ESTIMATOR_NAMES),
            shapes_reference=False,
            hint=_ASK.format(
                mode="Offboard",
                messages="32, 83 and 85",
                or_else=" (in PX4's console: mavlink stream -s ATTITUDE_TARGET -r 50, with -d or -u for the link)",
                own=".ulg",
            ),
        ),
    }
)
