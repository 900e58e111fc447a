"""When a log begins, by the clock that its recorder had: the vehicle's GPS or the ground station's."""

import io
import struct
from datetime import UTC, datetime, timedelta

import pytest

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.paparazzi.log import read_paparazzi
from app.autopilots.px4.log import read_px4
from tests.logs.recorded import OnBoardLog, ULogFile, recorded

NOON = datetime(2026, 11, 28, 12, tzinfo=UTC)
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
LEAP_S = timedelta(seconds=18)


def of_ardupilot(*fixes: tuple[float, datetime | None], restarts: bool = False) -> datetime | None:
    log = OnBoardLog()
    log.define(1, "GPS", "QBIH", "TimeUS,Status,GMS,GWk")
    for at_s, date in fixes:
        week, rest = divmod(date + LEAP_S - GPS_EPOCH, timedelta(weeks=1)) if date else (0, timedelta())
        log.add(1, "<QBIH", round(at_s * 1e6), 3, round(rest.total_seconds() * 1e3), week)
    if restarts:
        log.add(1, "<QBIH", 1_000, 0, 0, 0)
    return read_ardupilot(io.BytesIO(log.content)).started_at


def of_px4(*fixes: tuple[float, datetime | None], booted: datetime | None = None) -> datetime | None:
    log = ULogFile()
    if booted is not None:
        log.information("uint64_t boot_time_utc_us", struct.pack("<Q", round(booted.timestamp() * 1e6)))
    log.define("vehicle_gps_position", "uint64_t time_utc_usec;", "Q")
    for at_s, date in fixes:
        log.add("vehicle_gps_position", at_s, round(date.timestamp() * 1e6) if date else 0)
    return read_px4(io.BytesIO(log.content)).started_at


@pytest.mark.parametrize("date_of", [of_ardupilot, of_px4])
def test_an_on_board_log_is_dated_by_the_first_time_of_its_gps(date_of: object) -> None:
    assert callable(date_of)
    assert date_of((30.0, None), (40.0, NOON), (41.0, NOON + timedelta(seconds=1))) == NOON - timedelta(seconds=40)


@pytest.mark.parametrize("date_of", [of_ardupilot, of_px4])
@pytest.mark.parametrize("date", [None, datetime(1999, 8, 22, tzinfo=UTC), NOON + timedelta(days=7000)])
def test_a_log_without_a_fix_or_of_an_impossible_time_has_no_date(date_of: object, date: datetime | None) -> None:
    assert callable(date_of)
    assert date_of((40.0, date)) is None


def test_a_log_of_several_boots_has_no_date_because_nobody_knows_how_long_it_was_off() -> None:
    assert of_ardupilot((40.0, NOON), restarts=True) is None


def test_px4s_own_clock_dates_its_log_where_it_is_told() -> None:
    assert of_px4((40.0, NOON), booted=NOON - timedelta(hours=1)) == NOON - timedelta(hours=1)


def test_paparazzis_ground_log_is_dated_by_the_companion_of_the_same_name() -> None:
    data, companion = (io.BytesIO(recorded(f"paparazzi_steps{suffix}")) for suffix in (".data", ".log"))
    assert read_paparazzi(data, companion).started_at == datetime.fromtimestamp(1795862859.487, UTC)
    data.seek(0)
    assert read_paparazzi(data).started_at is None
