"""Telemetry logs without positions in the vehicle's own frame, as a ground station asks for them: what they tell."""

import io
import struct
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from app.autopilots.described import signals_of
from app.autopilots.log_readers import READERS, read_takeoffs
from app.autopilots.recording import Recording, release_of
from app.autopilots.tlog import read_tlog
from app.core.analysis.analysis import Grade
from app.core.analysis.description import Description, describe
from app.log_library.content import analyze_content
from app.logs.formats import Format
from tests.logs.recorded import BEGAN_US
from tests.logs.written_tlog import (
    ATTITUDE,
    CONTROLLER,
    GLOBAL_POSITION,
    GROUND_STATION,
    GUIDED,
    HUD,
    LOCAL_POSITION,
    LOITER,
    PX4_RECORDING,
    TARGET,
    frames_of,
    together,
)
from tests.logs.written_tlog import Recording as Flight

STATION = Flight(every=12, sends=GROUND_STATION, mode=LOITER)
PLAIN = replace(STATION, set_points=((0.0, 5.0),), lasts_s=30.0)
TAKEOFF = replace(STATION, set_points=((0.0, 0.0), (3.0, 3.0)), lasts_s=14.0)


def recording_of(content: bytes) -> Recording:
    return read_tlog(io.BytesIO(content))


def described(content: bytes | Recording) -> Description:
    signals = signals_of(content if isinstance(content, Recording) else recording_of(content))
    assert signals is not None
    found = describe(signals)
    assert found is not None
    return found


def stamped(content: bytes, began_us: int) -> bytes:
    """The same, of a ground station whose clock began elsewhere."""
    return b"".join(
        struct.pack(">Q", int.from_bytes(record[:8], "big") - BEGAN_US + began_us) + record[8:]
        for record in frames_of(content)
    )


@pytest.mark.parametrize("flight", [STATION, PLAIN, TAKEOFF], ids=["steps", "plain", "takeoff"])
def test_every_flight_has_its_hover_throttle_and_deviation(flight: Flight) -> None:
    """The vehicle hovers at 0.4; its throttle is reported in per cent."""
    found = described(flight.content)
    assert found.hover_throttle == pytest.approx(0.4, abs=0.01)
    assert found.deviation_mean_m is not None
    assert 0.0 < found.deviation_mean_m < 0.1
    assert found.held_s > 8.0


def test_a_flight_that_is_in_the_air_throughout_has_its_hover_at_its_lowest_too() -> None:
    """5 s at rest, and the beginning of a climb."""
    assert described(replace(STATION, lasts_s=6.0).content).hover_throttle == pytest.approx(0.4, abs=0.01)


def test_the_answer_names_what_more_it_would_need_and_the_margins_of_the_gains_flown() -> None:
    answer = analyze_content(TAKEOFF.content, None, "flight.tlog").answer
    assert (answer.tuning.grade, answer.frame) == (Grade.PARTIAL, "quadrotor")
    missing = {each.field: each.code for each in answer.tuning.reasons if each.code != "message_rare"}
    assert missing == {
        **dict.fromkeys(("LOCAL_POSITION_NED", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"), "message_missing"),
        "HEARTBEAT": "other_modes",
    }


def test_without_the_throttle_the_flight_is_described_by_its_altitude() -> None:
    found = described(replace(TAKEOFF, without=(HUD,)).content)
    assert found.hover_throttle is None
    assert found.flown_s == pytest.approx(10.0, abs=1.0)


def test_a_takeoff_in_it_may_be_imported() -> None:
    log = replace(TAKEOFF, every=5, parameters={**STATION.parameters, "PSC_ACCZ_D": 0.0})
    (found,) = read_takeoffs(io.BytesIO(log.content), name="flight.tlog")
    assert found.trajectory["altitude_m"].max() == pytest.approx(3.0, abs=0.1)
    assert recording_of(log.content).title.endswith("altitude from GLOBAL_POSITION_INT.relative_alt")


def test_targets_in_the_vehicles_own_frame_are_of_another_datum() -> None:
    """Seen: an estimator that began on a hill had a target 7 m above the altitude it kept."""
    told = recording_of(replace(STATION, sends=(GLOBAL_POSITION, HUD, TARGET)).content)
    assert described(told).deviation_mean_m is None
    assert described(told).hover_throttle == pytest.approx(0.4, abs=0.01)


def test_a_few_positions_in_its_own_frame_are_the_rest_of_a_test() -> None:
    few = replace(STATION, every=1, lasts_s=0.1, set_points=((0.0, 900.0),), sends=(LOCAL_POSITION,), parameters={})
    found = described(few.content + STATION.content)
    assert found.altitude_range_m == pytest.approx(2.0, abs=0.2)


def test_a_clock_of_the_position_above_home_that_stands_still_changes_nothing_else() -> None:
    """As of a vehicle that sends 0 for it: where its own frame has the time, no restart follows."""
    log = replace(STATION, sends=(LOCAL_POSITION, CONTROLLER, HUD), every=10).written()
    known = described(log.content)
    records = frames_of(log.content)
    stopped = Flight(lasts_s=0.02, sends=(), parameters={}).written()
    stopped.vehicle("global_position_int", *[0] * 9)
    zero = frames_of(stopped.content)[-1]
    mixed = b"".join(record + record[:8] + zero[8:] for record in records)
    assert recording_of(mixed).notes == []
    assert described(mixed) == known


def test_an_altitude_error_that_nobody_fills_in_is_no_deviation() -> None:
    """As PX4 reports it for a copter."""
    log = replace(PX4_RECORDING, every=12, sends=(GLOBAL_POSITION, HUD)).written()
    for _ in range(50):
        log.now_s += 0.2
        log.vehicle("global_position_int", log.boot_ms, 0, 0, 493_000, 5000, 0, 0, 0, 0)
        log.vehicle("nav_controller_output", *[0.0] * 2, 0, 0, 0, *[0.0] * 3)
    found = described(log.content)
    assert found.deviation_mean_m is None
    assert found.hover_throttle == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("later_s", [0.0, 0.1, 0.2])
def test_targets_that_come_after_the_position_count_too(later_s: float) -> None:
    """Twice a second, as PX4 sends them over a slow link."""
    sent = (LOCAL_POSITION, HUD, ATTITUDE)
    records = frames_of(replace(PX4_RECORDING, every=25, sends=sent).content)
    targets = frames_of(replace(PX4_RECORDING, every=25, sends=(TARGET,), parameters={}).content)
    late = [struct.pack(">Q", int.from_bytes(each[:8], "big") + round(1e6 * later_s)) + each[8:] for each in targets]
    found = described(together(b"".join(records), b"".join(late)))
    assert found.deviation_mean_m == pytest.approx(0.15, abs=0.05)


@pytest.mark.parametrize("began_us", [0, 300_000_000, BEGAN_US])
def test_two_boots_are_one_description_whatever_the_clock_of_the_ground(began_us: int) -> None:
    once, twice = PLAIN, replace(PLAIN, boots_at_s=15.0)
    found = described(stamped(twice.content, began_us))
    known = described(once.content)
    assert found.flown_s == pytest.approx(known.flown_s, abs=2.0)
    assert found.hover_throttle == pytest.approx(known.hover_throttle, abs=1e-6)
    told = recording_of(stamped(twice.content, began_us))
    assert told.notes == ["the vehicle restarted and reset its clock (1×)"]
    assert (told.started_at is None) is (began_us != BEGAN_US)


def test_of_two_vehicles_both_are_listed_and_one_chosen() -> None:
    """The second one hovers, and reports more often."""
    hovers = replace(PLAIN, system=9, every=5)
    content = together(STATION.content, hovers.content)
    everyone = recording_of(content)
    assert sorted(each.system for each in (everyone, *everyone.others)) == [1, 9]
    choose = READERS[Format.TLOG].vehicle
    assert choose(everyone, "flight.tlog").system == 1
    for system, alone in ((1, STATION), (9, hovers)):
        assert described(choose(everyone, "flight.tlog", system)) == described(alone.content)


def test_a_ground_station_that_reports_its_own_position_is_no_vehicle() -> None:
    """Whatever it claims to be; it has no attitude."""
    log = STATION.written()
    end_s, log.now_s = log.now_s, 100.0
    while log.now_s < end_s:
        log.now_s += 0.05
        log.add((255, 190), "heartbeat", 2, 3, 0, 0, 4)
        log.add((255, 190), "global_position_int", log.boot_ms, 0, 0, 0, 0, 0, 0, 0, 0)
    everyone = recording_of(together(log.content))
    assert (everyone.system, everyone.others, everyone.notes) == (1, [], [])
    assert described(everyone) == described(STATION.content)


@pytest.mark.parametrize(
    ("told", "release"),
    [
        ({}, ""),
        ({"flight_sw_version": 0x04050703 | 0xFF}, "4.5.7"),
        ({"flight_sw_version": 0x010F0000}, "1.15.0-dev"),
        ({"flight_sw_version": 0x01100240}, "1.16.2-alpha"),
        ({"flight_sw_version": 0x040600C0}, "4.6.0-rc"),
        ({"flight_sw_version": 0x04060007}, ""),
        ({"flight_sw_version": 0}, ""),
    ],
)
def test_the_release_is_that_of_the_firmware(told: Mapping[str, Any], release: str) -> None:
    log = replace(STATION, lasts_s=2.0).written()
    for version in told.values():
        log.vehicle("autopilot_version", 0, version, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0)
    assert recording_of(log.content).release == release
    answer = analyze_content(log.content, None, "flight.tlog").answer
    assert answer.release == (release or None)


def test_the_mode_is_the_one_flown() -> None:
    assert described(replace(STATION, mode=0).content).held_s == 0.0
    assert described(replace(STATION, mode=GUIDED).content).held_s > 15.0
    assert release_of(0) == ""
