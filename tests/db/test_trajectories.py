"""Trajectories as they are stored: every bit back, small, and damage noticed."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from app.common.errors import StorageError
from app.core.errors import TrajectoryError
from app.core.experiments.takeoff import Takeoff
from app.core.records.trajectory import Trajectory
from app.db.models import TrajectoryRow
from app.db.trajectories import pack, unpack
from tests.builders import create_climb

SINGLE = st.floats(width=32, allow_nan=False, allow_infinity=False)


@pytest.mark.complete
@given(
    columns=st.integers(1, 12).flatmap(
        lambda samples: st.lists(arrays(np.float64, samples, elements=SINGLE), min_size=0, max_size=5)
    )
)
def test_every_single_precision_number_comes_back_bit_for_bit(columns: list[NDArray[np.float64]]) -> None:
    samples = len(columns[0]) if columns else 3
    time_s = np.arange(samples) / 512.0 - 1.0
    trajectory = Trajectory(time_s, {f"c{index}": column for index, column in enumerate(columns)}, "test", "vehicle")
    back = unpack(pack(trajectory))
    assert (back.source, back.clock, list(back.channels)) == ("test", "vehicle", list(trajectory.channels))
    assert np.array_equal(back.time_s.view(np.int64), time_s.view(np.int64))
    for name, column in trajectory.channels.items():
        assert np.array_equal(back[name].view(np.int64), column.view(np.int64))  # also the sign of zero


def test_what_comes_back_is_what_the_core_calls_stored() -> None:
    trajectory = create_climb(0.7, rate_hz=512.0)
    back, stored = unpack(pack(trajectory)), trajectory.as_stored()
    assert np.array_equal(back.time_s, stored.time_s)
    assert np.array_equal(back["altitude_m"], stored["altitude_m"])


def test_a_takeoff_of_all_channels_takes_less_than_a_sixth_of_its_double_precision() -> None:
    takeoff = Takeoff()
    flight = takeoff.simulate(takeoff.space.default, takeoff.nominal_model)
    plain = 8 * len(flight) * (1 + len(flight.channels))
    assert len(pack(flight).data) < plain / 6


def changed(row: TrajectoryRow, **fields: Any) -> TrajectoryRow:
    return TrajectoryRow(**{each.key: getattr(row, each.key) for each in TrajectoryRow.__table__.columns} | fields)


def test_damage_is_noticed() -> None:
    packed = pack(create_climb())
    for position in (5, len(packed.data) // 2, len(packed.data) - 1):
        data = bytearray(packed.data)
        data[position] ^= 0x40
        with pytest.raises(StorageError, match="damaged"):
            unpack(changed(packed, data=bytes(data)))
    with pytest.raises(StorageError, match="damaged"):
        unpack(changed(packed, samples=packed.samples - 1))
    with pytest.raises(StorageError, match="damaged"):
        unpack(changed(packed, columns=["time_s", "height_m"]))
    with pytest.raises(StorageError, match="unknown version 2"):
        unpack(changed(packed, codec=2))


@pytest.mark.parametrize(
    ("time_s", "values", "field"),
    [
        ([], [], "time_s"),
        ([0.0, 1.0], [0.0, np.nan], "altitude_m"),
        ([0.0, 1.0], [0.0, 1e39], "altitude_m"),
        ([1e6, 1e6 + 0.001], [0.0, 0.0], "time_s"),  # single precision: 0.06 s apart at a million
    ],
)
def test_what_single_precision_cannot_hold_is_refused(time_s: list[float], values: list[float], field: str) -> None:
    trajectory = Trajectory(np.array(time_s), {"altitude_m": np.array(values)}, "test", "vehicle")
    with pytest.raises(TrajectoryError) as caught:
        pack(trajectory)
    assert caught.value.problems[0].field == field
