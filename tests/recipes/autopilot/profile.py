"""What is known of the toy: three modes, and the gains of a PID controller by names of its own."""

from typing import Final

from app.autopilots import commands, mavlink
from app.autopilots.autopilot import Autopilot, GainParameter
from app.autopilots.commands import Action, Step, Target
from app.autopilots.dialects import COMMON, Message, number
from app.autopilots.measurements import Measurement
from app.core.experiments.takeoff import Takeoff

MAKE: Final = 16
MANUAL, AUTO, LAND = 1, 2, 3
FACTORS: Final = {"kp": 0.0005, "ki": 0.002, "kd": 0.003}
"""From the gains of the takeoff to those on board."""


def _heartbeat(message: Message) -> Measurement | None:
    return mavlink.heartbeat(message, f"{number(message, 'custom_mode'):.0f}")


def _steps(action: Action, target: Target) -> tuple[Step, ...]:
    if action is Action.TAKE_OFF:
        above = commands.command(target, 22, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, target.altitude_m)
        return (Step((above,), awaits="command 22", attempts=1),)
    steps = commands.copter_steps(action, target, LAND)
    return (Step((commands.set_mode(target, AUTO),), awaits="command 176"), *steps) if action is Action.ARM else steps


TOY: Final = Autopilot(
    name="toy",
    title="Toy",
    label="Toy",
    experiments=(Takeoff(),),
    dialect=COMMON,
    autopilot=MAKE,
    lift_off_s=3.0,
    reference="target",
    flying_modes=frozenset({str(AUTO)}),
    following_modes=frozenset({str(AUTO)}),
    landing_modes=frozenset({str(LAND)}),
    automatic_modes=frozenset({str(AUTO), str(LAND)}),
    mode_names={str(MANUAL): "Manual", str(AUTO): "Automatic", str(LAND): "Landing"},
    gain_sets=(
        (
            GainParameter("kp", "TOY_P", 0.0, 4000.0, FACTORS["kp"]),
            GainParameter("ki", "TOY_I", 0.0, 1073.0, FACTORS["ki"], integrates=True),
            GainParameter("kd", "TOY_D", 0.0, 409.0, FACTORS["kd"]),
        ),
    ),
    readers={**mavlink.READERS, "HEARTBEAT": _heartbeat},
    telemetry=commands.COPTER_TELEMETRY,
    steps=_steps,
)
