"""Placeholders for vehicles of other installations, for imported campaigns; they never fly from here."""

from collections.abc import Mapping
from itertools import count
from typing import Final

from sqlalchemy.orm import Session

from app.common.schemas import OptionValue
from app.common.states import VehicleState
from app.db.models import VehicleRow
from app.fleet import repository
from app.vehicles.imported import IMPORT

_ROOM: Final = 90
_KIND: Final = "origin"
_NAME: Final = "origin_name"


def get_or_create_imported_vehicle(
    session: Session, *, name: str, kind: str, is_real: bool, safe_gains: Mapping[str, float]
) -> VehicleRow:
    """Return the placeholder for a vehicle of that name and kind; create it if there is none.

    Its kind is `import`, so that it cannot be flown, and it has no ledger, because no gains were sent to it from here.
    """
    origin: dict[str, OptionValue] = {_KIND: kind, _NAME: name}
    for number in count(1):
        called = f"{name[:_ROOM]} (elsewhere{'' if number == 1 else f', {number}'})"
        known = repository.of_name_or_none(session, called)
        if known is None:
            return _made(session, called, is_real=is_real, options=origin, safe_gains=safe_gains)
        if (known.kind, known.registered, known.is_real, known.options) == (IMPORT.name, False, is_real, origin):
            return known
    raise AssertionError("numbers do not end")


def origin_of(row: VehicleRow) -> tuple[str, str] | None:
    """Kind and name of the vehicle that a placeholder stands for; None for a vehicle of this installation."""
    if row.registered or _KIND not in row.options:
        return None
    return str(row.options[_KIND]), str(row.options[_NAME])


def _made(
    session: Session, name: str, *, is_real: bool, options: dict[str, OptionValue], safe_gains: Mapping[str, float]
) -> VehicleRow:
    row = VehicleRow(
        kind=IMPORT.name,
        name=name,
        title=IMPORT.title,
        is_real=is_real,
        options=options,
        safe_gains=dict(safe_gains),
        state=VehicleState.DISCONNECTED,
    )
    session.add(row)
    session.flush()
    return row
