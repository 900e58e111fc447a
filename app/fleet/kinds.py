"""Capabilities of a vehicle by its kind."""

from app.common.schemas import OptionValue
from app.db.models import VehicleRow
from app.vehicles.kinds import VehicleKind
from app.vehicles.open import VEHICLE_KINDS


def can_fly(row: VehicleRow) -> bool:
    """Whether the program can fly it, rather than import records of flights made elsewhere."""
    kind = VEHICLE_KINDS.get(row.kind)
    return kind is not None and kind.can_fly


def experiments_of(row: VehicleRow) -> list[str]:
    """Experiments whose gains the vehicle has; for a shared vehicle, all that its kind can fly."""
    kind = VEHICLE_KINDS.get(row.kind)
    if kind is None:
        return []
    return list(kind.experiments_with(row.options) if row.registered else kind.experiments)


def settings_of(row: VehicleRow) -> dict[str, OptionValue]:
    """The settings of a registered vehicle, with defaults filled in."""
    kind = VEHICLE_KINDS.get(row.kind)
    return dict(row.options) if kind is None else kind.completed(row.options)


def is_registered_one_by_one(kind: VehicleKind) -> bool:
    """Whether each vehicle of the kind has its own row, settings and link, rather than one shared by all campaigns.

    True for kinds that include real vehicles and that the program flies.
    """
    return kind.is_real and kind.can_fly


def needs_staging(row: VehicleRow) -> bool:
    """Whether a person's own act is required between staging and take-off: the vehicle is real and registered."""
    return row.is_real and row.registered
