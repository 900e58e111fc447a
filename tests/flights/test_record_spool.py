"""Flight records on disk: claimed before lift-off, complete or absent afterwards."""

from pathlib import Path

import numpy as np
import pytest

from app.common.errors import InputError
from app.core.records.trajectory import Trajectory
from app.flights.record_spool import RESERVED_BYTES, Spool
from app.vehicles.base import FlightRecord
from app.vehicles.flight_end import Failure, FlightEnd, StopRequest


def record() -> FlightRecord:
    time_s = np.arange(-512, 6144) / 512.0
    return FlightRecord(
        trajectory=Trajectory(
            time_s, {"altitude_m": np.sqrt(np.abs(time_s)), "thrust": np.cos(time_s)}, "twin", "simulation"
        ),
        ending="aborted",
        end=FlightEnd(failure=Failure.OPERATOR, request=StopRequest("Ordered, with an ü.")),
        settings={"scatter": 1.0, "quiet": True},
    )


def test_a_record_comes_back_bit_for_bit(tmp_path: Path) -> None:
    spool, flown = Spool(tmp_path / "spool"), record()
    spool.reserve(7)
    assert spool.flight_ids() == []
    spool.write(7, flown)
    assert spool.flight_ids() == [7]
    kept = spool.read(7)
    assert (kept.ending, kept.end, kept.settings) == (
        flown.ending,
        flown.end,
        flown.settings,
    )
    np.testing.assert_array_equal(kept.trajectory.time_s, flown.trajectory.time_s)
    assert list(kept.trajectory.channels) == ["altitude_m", "thrust"]
    for name, values in flown.trajectory.channels.items():
        np.testing.assert_array_equal(kept.trajectory[name], values)
    spool.delete(7)
    assert list((tmp_path / "spool").iterdir()) == []


def test_the_room_is_really_taken_before_the_flight(tmp_path: Path) -> None:
    Spool(tmp_path).reserve(1)
    (room,) = tmp_path.iterdir()
    assert room.stat().st_blocks * 512 >= RESERVED_BYTES


def test_a_claim_without_a_record_is_swept_away_and_a_record_stays(tmp_path: Path) -> None:
    spool = Spool(tmp_path)
    spool.reserve(1)
    spool.reserve(2)
    spool.write(2, record())
    spool.delete_unfinished()
    assert [path.name for path in tmp_path.iterdir()] == ["2.flight"]


def test_a_damaged_record_is_refused_and_can_be_set_aside(tmp_path: Path) -> None:
    spool = Spool(tmp_path)
    spool.reserve(1)
    spool.write(1, record())
    path = tmp_path / "1.flight"
    content = bytearray(path.read_bytes())
    content[5000] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="checksum"):
        spool.read(1)
    aside = spool.set_aside(1)
    assert aside is not None
    assert Path(aside).read_bytes() == bytes(content)
    assert spool.flight_ids() == []
