"""Flights of logs as the database has them: predicted as before they were packed, in few bytes, and refused if they are
damaged."""

import io
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
import zstandard

from app.autopilots.log_readers import reader_of
from app.common.errors import StorageError
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.prediction import FlightModel
from app.core.reasons import Reason, ReasonCode
from app.log_library.flights import LARGEST_BYTES, pack_flight, unpack_flight
from app.logs.base import HEAD_BYTES
from tests.core.analysis.flights import QUIET, simulated_flight
from tests.core.tuning.flying import compiled_only
from tests.logs.recorded import recorded
from tests.logs.test_copter_releases import motion
from tests.logs.written_releases import RELEASES

pytestmark = compiled_only

COPTERS = [QUIET.linear, replace(QUIET.linear, thrust_slope=1.2)]


def logged(content: bytes) -> LoggedFlight:
    reader = reader_of(content[:HEAD_BYTES])
    assert reader is not None
    flight = reader.flown(reader.read(io.BytesIO(content), None), "The log")
    assert isinstance(flight, LoggedFlight)
    return flight


def noisy(flight: LoggedFlight, changes_m: list[float], *, rows: int = 340) -> LoggedFlight:
    """Segments of the flight's kind, of rows that hardly pack, and a reference that changes by so much."""
    (segment,), random = flight.segments, np.random.default_rng(1)
    time_s = np.cumsum(random.uniform(0.09, 0.11, rows), dtype=np.float64)
    names = {each.name for each in fields(segment)} - {"time_s", "z_d_m"}
    return replace(
        flight,
        segments=[
            replace(
                segment,
                time_s=time_s + 1e3 * place,
                z_d_m=np.linspace(0.0, change_m, rows),
                **{name: random.normal(scale=9.0, size=rows) for name in names},
            )
            for place, change_m in enumerate(changes_m)
        ],
    )


def assert_predicted_alike(before: LoggedFlight, after: LoggedFlight) -> None:
    models = [FlightModel(each, COPTERS) for each in (before, after)]
    for factor in (1.0, 0.6, 1.6):
        loop = before.loop.with_gains({name: factor * value for name, value in before.loop.gains.items()})
        known, found = (model.predict(loop) for model in models)
        assert found.error_m == pytest.approx(known.error_m, rel=0.01)
        assert found.activity == pytest.approx(known.activity, rel=0.01)


@pytest.mark.parametrize(
    "name",
    ["arducopter_steps.bin", "arducopter_guided_wind.bin", "arducopter_guided_wind.tlog", "px4_steps.ulg", "3.6"],
)
def test_a_flight_is_predicted_as_before_it_was_packed(name: str) -> None:
    content = RELEASES[name].log(motion("steps", name)) if name in RELEASES else recorded(name)
    flight = logged(content)
    packed = pack_flight(flight, COPTERS)
    stored = unpack_flight(packed)
    assert len(packed) < 8 * 1024
    assert (stored.flight.loop, stored.copters, stored.left_out) == (flight.loop, COPTERS, 0)
    assert (stored.flight.activity, stored.flight.lacks) == (flight.activity, flight.lacks)
    assert_predicted_alike(flight, stored.flight)


def test_why_other_gains_cannot_be_predicted_is_kept() -> None:
    why = Reason(code=ReasonCode.FEED_FORWARD_UNKNOWN)
    assert unpack_flight(pack_flight(replace(simulated_flight(), lacks=why), COPTERS)).flight.lacks == why


def test_segments_with_the_least_altitude_change_are_left_out() -> None:
    flight = noisy(simulated_flight(), [1.0, 5.0, 0.1, 3.0, 4.0, 0.2])
    packed = pack_flight(flight, COPTERS)
    stored = unpack_flight(packed)
    changes_m = [float(np.ptp(each.z_d_m)) for each in stored.flight.segments]
    assert len(packed) <= LARGEST_BYTES
    assert stored.left_out == 6 - len(changes_m)
    assert changes_m == pytest.approx(
        [each for each in (1.0, 5.0, 0.1, 3.0, 4.0, 0.2) if each >= min(changes_m) - 0.01]
    )


def test_of_a_segment_that_is_too_long_the_end_is_left_out() -> None:
    flight = noisy(simulated_flight(), [2.0], rows=2000)
    packed = pack_flight(flight, COPTERS)
    (segment,) = unpack_flight(packed).flight.segments
    assert len(packed) <= LARGEST_BYTES
    assert 500 <= len(segment.time_s) < 2000
    assert segment.time_s == pytest.approx(flight.segments[0].time_s[: len(segment.time_s)], abs=1e-6)


def repacked(change: Callable[[bytes], bytes]) -> bytes:
    """A packed flight with other content before compression."""
    packed = pack_flight(simulated_flight(), COPTERS)
    plain = zstandard.ZstdDecompressor().decompress(packed[1:])
    return packed[:1] + zstandard.compress(change(plain))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x01",
        b"\x02" + pack_flight(simulated_flight(), COPTERS)[1:],
        pack_flight(simulated_flight(), COPTERS)[:-9],
        repacked(lambda plain: plain[:-4]),
        repacked(lambda plain: plain[:-3]),
        repacked(lambda plain: plain.replace(b'"Segment"', b'"Sediment"')),
        repacked(lambda plain: plain.replace(b"ArduCopter", b"AnotherOne")),
        repacked(lambda plain: plain.replace(b'"copters":[', b'"copters":[7,')),
        repacked(lambda plain: plain.replace(b'"position_p_1_s":', b'"position_p_1_s":-')),
        repacked(lambda plain: plain.replace(b'"z_m":', b'"zz_m":')),
    ],
)
def test_a_damaged_or_unknown_flight_is_refused(content: bytes) -> None:
    with pytest.raises(StorageError):
        unpack_flight(content)
