"""Where a vehicle stands, by what was heard of it on the ground."""

from dataclasses import replace

import pytest

from app.vehicles.mavlink.events import Position
from app.vehicles.mavlink.preflight import GroundObservation

HEARD = tuple(Position(60.0 + 0.02 * count, 0.1, 0.0) for count in range(100))
STRANGE = (replace(HEARD[0], time_boot_s=3661.0), replace(HEARD[0], time_boot_s=0.2))


@pytest.mark.parametrize("strange", STRANGE, ids=["an hour ahead", "of a boot"])
@pytest.mark.parametrize("after", [0, 1])
def test_one_position_by_another_clock_is_not_where_its_record_begins(strange: Position, after: int) -> None:
    """All that it says itself would be taken for that of a vehicle which has rebooted."""
    positions = (*HEARD[: len(HEARD) - after], strange, *HEARD[len(HEARD) - after :])
    last = GroundObservation(positions, 2.0).ground.last
    assert last in HEARD
    assert last.time_boot_s > 61.9


def test_a_single_position_is_the_last_one() -> None:
    assert GroundObservation(HEARD[:1], 2.0).ground.last == HEARD[0]
