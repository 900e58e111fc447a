"""Registry of the kinds of vehicle, and opening of a vehicle. Flights of the kind `import` are uploaded as files."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NoReturn

from app.autopilots.registry import AUTOPILOTS
from app.core.errors import GainlineError, InputError, Problem
from app.core.formatting import format_gains
from app.core.policy import Gains
from app.vehicles.base import OptionValue, SafeGainsError, Vehicle, VehicleError, find_mismatch
from app.vehicles.f16 import LTI
from app.vehicles.jsbsim import JSBSIM
from app.vehicles.kinds import Options, VehicleKind
from app.vehicles.mavlink_kind import MAVLINK
from app.vehicles.twin import TWIN


def _open(_options: Options, _safe_gains: Gains, _trial_parameters: Path | None) -> NoReturn:
    raise VehicleError(
        "This vehicle is flown outside Gainline, which cannot command it.",
        hint="Fly the proposed gains yourself, then upload the flight's log, or a CSV with the columns time_s and "
        "altitude_m.",
    )


IMPORT: Final = VehicleKind(
    name="import",
    title="Flown elsewhere",
    line="You fly the proposed gains on your own vehicle and upload its log, or the altitude as CSV.",
    is_real=True,
    can_fly=False,
    experiments=tuple(dict.fromkeys(each.experiments[0].name for each in AUTOPILOTS.values())),
    options=(),
    open=_open,
)


VEHICLE_KINDS: Final[Mapping[str, VehicleKind]] = {kind.name: kind for kind in (JSBSIM, TWIN, LTI, MAVLINK, IMPORT)}


def get_kind(kind: str, *, field: str = "vehicle.kind") -> VehicleKind:
    """Return the kind of this name. Raises InputError if it is unknown."""
    if kind not in VEHICLE_KINDS:
        raise InputError(
            "There is no such vehicle.",
            hint="Choose another.",
            problems=(Problem(field, f"must be one of {', '.join(VEHICLE_KINDS)}, got {kind!r}"),),
        )
    return VEHICLE_KINDS[kind]


def check_options(kind: str, options: Mapping[str, object], *, field: str = "vehicle") -> dict[str, OptionValue]:
    """Return the options of a vehicle completed with their defaults.

    Raises InputError naming every field that is unknown or out of range as `<field>.options.<name>`.
    """
    return get_kind(kind, field=f"{field}.kind").check(options, field=f"{field}.options")


@contextmanager
def open_vehicle(
    kind: str, options: Mapping[str, object], *, safe_gains: Gains, trial_parameters: Path | None = None
) -> Iterator[Vehicle]:
    """Open a vehicle; on any exit, exceptions included, write `safe_gains` and read them back.

    Parameters that a trial changes in addition to the gains are kept in the folder `trial_parameters` until they are
    restored. Raises InputError for invalid options, VehicleError if the vehicle cannot be opened, and SafeGainsError if
    the safe gains could not be verified at the end.
    """
    vehicle = get_kind(kind).open(check_options(kind, options), safe_gains, trial_parameters)
    try:
        yield vehicle
    finally:
        try:
            restore_safe_gains(vehicle)
        except SafeGainsError:
            with suppress(Exception):  # the SafeGainsError must reach the caller
                vehicle.close()
            raise
        vehicle.close()


def restore_safe_gains(vehicle: Vehicle) -> dict[str, float]:
    """Write the safe gains and return the values read back. Raises SafeGainsError if they differ."""
    wanted = dict(vehicle.safe_gains)
    hint = "Do not fly it before its gains have been set and read back."
    try:
        held = vehicle.stage(wanted)
    except Exception as error:
        why = error.message if isinstance(error, GainlineError) else f"{error}."
        raise SafeGainsError(
            f"The vehicle's safe gains ({format_gains(wanted)}) could not be set. {why}", hint=hint
        ) from error
    if mismatch := find_mismatch(held, wanted):
        raise SafeGainsError(f"The vehicle does not hold its safe gains: {mismatch}.", hint=hint)
    return held
