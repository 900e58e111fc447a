"""A vehicle that flies elsewhere: its flights come in as files."""

from pathlib import Path
from typing import Final, NoReturn

from app.core.policy import Gains
from app.vehicles.errors import VehicleError
from app.vehicles.kinds import Options, VehicleKind


def _open(_options: Options, _safe_gains: Gains, _trial_parameters: Path | None) -> NoReturn:
    raise VehicleError(
        "This vehicle flies elsewhere, so this program cannot fly it.",
        hint="Fly the proposed gains yourself, then upload the flight's log, or a CSV with the columns time_s and "
        "altitude_m.",
    )


IMPORT: Final = VehicleKind(
    name="import",
    title="Flown elsewhere",
    line="You fly the proposed gains on your own vehicle and upload its log, or the altitude as CSV.",
    is_real=True,
    can_fly=False,
    experiments=("takeoff", "takeoff-ardupilot", "takeoff-px4"),
    options=(),
    open=_open,
)
