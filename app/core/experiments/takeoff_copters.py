"""The paper's takeoff under ArduCopter or PX4: gains of their own vertical controllers, without a model so far.

Flown and scored like the paper's; a person or a script chooses every gain set. The ranges are those that may be written
to such a vehicle at all: a campaign narrows them to suit its vehicle.
"""

from collections.abc import Mapping
from typing import Final, Self

from app.core.definition import OptionValue
from app.core.experiments.base import Matrix, Scatter
from app.core.experiments.takeoff import Takeoff
from app.core.options import Option
from app.core.policy import Gain, PolicySpace, Vector
from app.core.trajectory import Samples, Trajectory

_PAPER: Final = Takeoff()


def _gain(name: str, title: str, unit: str, lower: float, upper: float, default: float) -> Gain:
    return Gain(name, title, unit, lower=lower, upper=upper, scale=upper / 10, default=default, integer=False)


ARDUPILOT_GAINS: Final = (
    _gain("PSC_POSZ_P", "Climb rate per altitude error", "1/s", 0.1, 4.0, 1.0),
    _gain("PSC_VELZ_P", "Acceleration per climb rate error", "1/s", 0.5, 10.0, 5.0),
    _gain("PSC_ACCZ_P", "Thrust per acceleration error", "10 %·s²/m", 0.05, 2.0, 0.5),
    _gain("PSC_ACCZ_I", "Thrust per integrated acceleration error", "10 %·s/m", 0.0, 4.0, 1.0),
    _gain("PSC_ACCZ_D", "Thrust per change of acceleration error", "10 %·s³/m", 0.0, 0.4, 0.0),
)
"""Names and defaults before release 4.7; from 4.7 on the names differ, and the acceleration gains are a tenth."""

PX4_GAINS: Final = (
    _gain("MPC_Z_P", "Climb rate per altitude error", "1/s", 0.1, 1.5, 1.0),
    _gain("MPC_Z_VEL_P_ACC", "Acceleration per climb rate error", "1/s", 2.0, 15.0, 4.0),
    _gain("MPC_Z_VEL_I_ACC", "Acceleration per integrated climb rate error", "1/s²", 0.2, 3.0, 2.0),
    _gain("MPC_Z_VEL_D_ACC", "Acceleration per measured acceleration", "1", 0.0, 2.0, 0.0),
)


class CopterTakeoff:
    """The paper's takeoff, manoeuvre and score, with the gains of another autopilot."""

    options: Final[tuple[Option, ...]] = ()
    modelled: Final = None
    output: Final = _PAPER.output
    integrates: Final = _PAPER.integrates
    error_unit: Final = _PAPER.error_unit
    scatter: Final = Scatter(sd=_PAPER.scatter.sd, degrees_of_freedom=1.0, measured=False)
    """The scatter of the paper's drone, as none was measured; under PX4 one flight scattered three times as much."""

    def __init__(self, name: str, autopilot: str, gains: tuple[Gain, ...]) -> None:
        self.name: Final = name
        self.title: Final = f"{_PAPER.title} under {autopilot}"
        self.space: Final = PolicySpace(gains)

    def configured(self, options: Mapping[str, OptionValue]) -> Self:  # noqa: ARG002 - there are none
        """The experiment itself: it has no settings."""
        return self

    @property
    def grid_s(self) -> Samples:
        """The same as the paper's takeoff."""
        return _PAPER.grid_s

    def set_point(self, time_s: Samples) -> Samples:
        """3 m from the command on."""
        return _PAPER.set_point(time_s)

    def errors(self, outputs: Matrix) -> Vector:
        """Mean absolute altitude error, m, over 32.6 s: (k, 16693) → (k,)."""
        return _PAPER.errors(outputs)

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same for a recorded flight. Raises TrajectoryError if it has gaps or does not cover the window."""
        return _PAPER.error(trajectory, accept_gaps=accept_gaps)


TAKEOFF_ARDUPILOT: Final = CopterTakeoff("takeoff-ardupilot", "ArduCopter", ARDUPILOT_GAINS)
TAKEOFF_PX4: Final = CopterTakeoff("takeoff-px4", "PX4", PX4_GAINS)
