"""What a vehicle can do by its kind."""

from app.db.models import VehicleRow
from app.schemas import OptionValue
from app.vehicles.kinds import VehicleKind
from app.vehicles.open import VEHICLE_KINDS


def can_fly(row: VehicleRow) -> bool:
    """Whether the program can fly it, rather than take records of flights made elsewhere."""
    kind = VEHICLE_KINDS.get(row.kind)
    return kind is not None and kind.can_fly


def experiments_of(row: VehicleRow) -> list[str]:
    """Those whose gains the vehicle has; of a shared one, all that its kind can fly."""
    kind = VEHICLE_KINDS.get(row.kind)
    if kind is None:
        return []
    return list(kind.experiments_with(row.options) if row.registered else kind.experiments)


def settings_of(row: VehicleRow) -> dict[str, OptionValue]:
    """What a registered vehicle is registered with, complete."""
    kind = VEHICLE_KINDS.get(row.kind)
    return dict(row.options) if kind is None else kind.completed(row.options)


def is_registered_one_by_one(kind: VehicleKind) -> bool:
    """Whether each vehicle of the kind has a row, settings and a link of its own, rather than one shared by all
    campaigns: there are real ones among them, and the program flies them."""
    return kind.is_real and kind.can_fly


def needs_staging(row: VehicleRow) -> bool:
    """Whether a person's own act lies between the gains on the vehicle and its take-off: it is real, and the program
    keeps a link to it."""
    return row.is_real and row.registered
