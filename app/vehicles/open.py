"""The vehicles there are, and the one way to take control of one."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Final

from app.core.errors import InputError, Problem
from app.core.policy import Gains
from app.vehicles.base import OptionValue, Vehicle
from app.vehicles.errors import SafeGainsError
from app.vehicles.imported import IMPORT
from app.vehicles.jsbsim.kind import JSBSIM
from app.vehicles.kinds import VehicleKind
from app.vehicles.lti import LTI
from app.vehicles.mavlink.kind import MAVLINK
from app.vehicles.twin import TWIN

VEHICLE_KINDS: Final[Mapping[str, VehicleKind]] = MappingProxyType(
    {kind.name: kind for kind in (JSBSIM, TWIN, LTI, MAVLINK, IMPORT)}
)


def get_kind(kind: str, *, field: str = "vehicle.kind") -> VehicleKind:
    """Raises InputError when there is no vehicle of that kind."""
    if kind not in VEHICLE_KINDS:
        raise InputError(
            "There is no such vehicle.",
            hint=f"Choose one of: {', '.join(VEHICLE_KINDS)}.",
            problems=(Problem(field, f"unknown kind {kind!r}"),),
        )
    return VEHICLE_KINDS[kind]


def check_options(kind: str, options: Mapping[str, object], *, field: str = "vehicle") -> dict[str, OptionValue]:
    """The options of a vehicle completed with their defaults.

    Raises InputError naming every field that is unknown or out of range as `<field>.options.<name>`.
    """
    return get_kind(kind, field=f"{field}.kind").check(options, field=f"{field}.options")


@contextmanager
def open_vehicle(
    kind: str, options: Mapping[str, object], *, safe_gains: Gains, trial_parameters: Path | None = None
) -> Iterator[Vehicle]:
    """Control of one vehicle; on any exit, an exception included, it is left holding `safe_gains`, read back. What a
    trial changes on it beside the gains is kept in the folder `trial_parameters` until it is put back.

    Raises InputError for options it cannot have, VehicleError when it cannot be opened, and SafeGainsError when the
    safe gains could not be verified at the end.
    """
    vehicle = get_kind(kind).open(check_options(kind, options), safe_gains, trial_parameters)
    try:
        yield vehicle
    finally:
        try:
            restore_safe_gains(vehicle)
        except SafeGainsError:
            with suppress(Exception):  # what must be heard is that its gains are in doubt
                vehicle.close()
            raise
        vehicle.close()


def restore_safe_gains(vehicle: Vehicle) -> dict[str, float]:
    """Write the safe gains and give what was read back, which is them. Raises SafeGainsError when it is not."""
    wanted = dict(vehicle.safe_gains)
    hint = "Do not fly it. Set its gains by hand, read them back, then release it."
    try:
        held = vehicle.stage(wanted)
    except Exception as error:
        raise SafeGainsError(f"The vehicle's safe gains {wanted} could not be set: {error}", hint=hint) from error
    if held != wanted:
        raise SafeGainsError(f"The vehicle holds {held} instead of its safe gains {wanted}.", hint=hint)
    return held
