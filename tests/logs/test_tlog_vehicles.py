"""Telemetry logs: whose messages count, and what a log of more than one vehicle, or of a damaged or odd link, gives."""

import io
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
import pytest
from pymavlink.dialects.v10 import ardupilotmega as mavlink_1
from pymavlink.dialects.v20 import ardupilotmega

from app.autopilots.copter_tlog import copter_steps
from app.autopilots.frames import frame_of
from app.autopilots.log_readers import READERS, read_takeoff, read_takeoffs
from app.autopilots.recording import Recording
from app.autopilots.takeoffs import Takeoff
from app.autopilots.tlog import read_tlog
from app.core.analysis.loop import LoggedFlight
from app.core.errors import TrajectoryError
from app.core.reasons import OTHER_FRAMES
from app.log_library.content import analyze_content
from app.logs.base import HEAD_BYTES
from app.logs.formats import Format, recognise
from tests.logs.recorded import BEGAN_US, Telemetry, recorded
from tests.logs.written_tlog import LOITER, frames_of, together
from tests.logs.written_tlog import Recording as Steps

STEPS = Steps(every=2)
GAINS = {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.0, "PSC_ACCZ_D": 0.0}
Address = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Beside:
    """Another program's heartbeat each second: its address, type, autopilot, mode; and its reports, 30 of each."""

    address: Address
    kind: int = 18
    autopilot: int = 8
    armed: bool = False
    reports: Sequence[str] = ()

    def write(self, log: Telemetry) -> None:
        log.add(self.address, "heartbeat", self.kind, self.autopilot, 128 * self.armed, 0, 4)
        for kind in self.reports:
            for _ in range(30):
                log.add(self.address, kind, log.boot_ms, *([0] * 8 if kind == "global_position_int" else [0.0] * 6))


def flight(
    *beside: Beside,
    system: int = 1,
    component: int = 1,
    rate_hz: float = 20.0,
    lasts_s: int = 10,
    dialect: object = ardupilotmega,
    waits_s: int = 2,
    scale: float = 1.0,
    written: Callable[[Telemetry], object] = id,
) -> Telemetry:
    """A takeoff to 3 m under ArduPilot after `waits_s`, with other programs' heartbeats `beside` the vehicle's; how the
    log is `written` is set first."""
    log = Telemetry(dialect, autopilot=3, system=system, component=component)
    written(log)
    for second in range(waits_s + lasts_s):
        for each in beside:
            each.write(log)
        log.heartbeat(mode=4)
        if second == 0:
            for name, value in GAINS.items():
                log.parameter(name, scale * value)
        if second == waits_s:
            log.ground("command_long", system, component, 22, 0, 0, 0, 0, 0, 0, 0, 3.0)
            log.vehicle("command_ack", 22, 0)
        for _ in range(round(rate_hz)):
            log.fly(1.0 / rate_hz, to_m=3.0 * (second >= waits_s), rate_hz=rate_hz)
            for kind in ("attitude", "global_position_int"):
                log.vehicle(kind, log.boot_ms, *([0.0] * 6 if kind == "attitude" else [0] * 8))
    return log


def takeoffs(log: Telemetry | bytes) -> Sequence[Takeoff]:
    return read_takeoffs(io.BytesIO(log if isinstance(log, bytes) else log.content), name="flight.tlog")


def same(found: Takeoff, known: Takeoff) -> bool:
    return (
        found.begins_with == known.begins_with
        and found.gains == known.gains
        and found.start_s == pytest.approx(known.start_s, abs=1e-6)
        and np.array_equal(found.trajectory.time_s, known.trajectory.time_s)
        and np.array_equal(found.trajectory["altitude_m"], known.trajectory["altitude_m"])
    )


@pytest.mark.parametrize("rate_hz", [20.0, 4.0])
@pytest.mark.parametrize(
    "beside",
    [
        Beside(address=(1, 154)),
        Beside(address=(1, 191), autopilot=3),
        Beside(address=(1, 191), autopilot=12, kind=2),
        Beside(address=(1, 191), autopilot=3, kind=2, reports=("attitude",)),
        Beside(address=(1, 191), autopilot=3, kind=2, reports=("attitude", "local_position_ned")),
        Beside(address=(1, 154), autopilot=3, kind=26, reports=("attitude", "local_position_ned")),
        Beside(address=(1, 1), kind=6),
        Beside(address=(1, 190), kind=6, autopilot=3, armed=True),
        Beside(address=(255, 190), kind=6, autopilot=3, armed=True),
        Beside(address=(255, 190), kind=2, autopilot=3, reports=("global_position_int",)),
    ],
    ids=str,
)
def test_only_the_autopilot_s_heartbeats_count_whatever_others_claim(beside: Beside, rate_hz: float) -> None:
    (alone,) = takeoffs(flight(rate_hz=rate_hz))
    (found,) = takeoffs(flight(beside, rate_hz=rate_hz))
    assert same(found, alone)
    assert found.trajectory.time_s[-1] == pytest.approx(10.0, abs=0.3)
    assert found.notes == alone.notes


def test_the_autopilot_may_be_on_another_component_and_heard_last() -> None:
    """A companion computer is on the component that is usually the autopilot's."""
    companion = Beside(address=(1, 1), autopilot=3, kind=2)
    (found,) = takeoffs(flight(companion, component=50))
    assert same(found, takeoffs(flight(component=50))[0])


def test_a_command_counts_whoever_gives_it_and_only_the_one_for_this_vehicle() -> None:
    def companion_asks(log: Telemetry) -> None:
        log.add((1, 191), "command_long", 1, 1, 22, 0, 0, 0, 0, 0, 0, 0, 3.0)
        log.add((1, 191), "command_long", 1, 154, 21, 0, 0, 0, 0, 0, 0, 0, 3.0)

    def other_asked(log: Telemetry) -> None:
        log.ground("command_long", 7, 1, 22, 0, 0, 0, 0, 0, 0, 0, 3.0)

    def stands_up(asks: Callable[[Telemetry], None]) -> Takeoff:
        log = Telemetry(ardupilotmega, autopilot=3, system=1)
        log.heartbeat()
        log.fly(2.0, to_m=0.0)
        asks(log)
        log.fly(8.0, to_m=3.0)
        return takeoffs(log)[0]

    assert stands_up(companion_asks).begins_with == "the command NAV_TAKEOFF"
    assert stands_up(other_asked).begins_with == "lift-off"


def test_takeoffs_of_two_vehicles_are_listed_and_numbered_over_both_and_never_mixed() -> None:
    first, second = flight(system=1), flight(system=2, waits_s=5, scale=2.0)
    found = takeoffs(together(second.content, first.content))
    assert [each.number for each in found] == [1, 2]
    assert [each.system for each in found] == [1, 2]
    assert [each.start_s for each in found] == pytest.approx([2.0, 5.0], abs=0.05)
    assert [each.gains["PSC_VELZ_P"] for each in found] == [5.0, 10.0]
    for each, alone in zip(found, (first, second), strict=True):
        assert np.array_equal(each.trajectory["altitude_m"], takeoffs(alone)[0].trajectory["altitude_m"])
    assert "another vehicle in the log, system 2 under ArduPilot" in found[0].notes
    with pytest.raises(TrajectoryError) as listed:
        read_takeoff(io.BytesIO(together(second.content, first.content)))
    assert [each.reason[:13] for each in listed.value.problems] == ["1: system 1, ", "2: system 2, "]


def test_a_vehicle_that_stands_by_is_no_reason_to_refuse_the_one_that_flies() -> None:
    idle = Telemetry(ardupilotmega, autopilot=3, system=2)
    for _ in range(30):
        idle.heartbeat(armed=False)
        idle.fly(1.0, to_m=0.0, rate_hz=60.0)
    (found,) = takeoffs(together(idle.content, flight().content))
    assert (found.number, found.system) == (1, 1)
    with pytest.raises(TrajectoryError, match=r"system 2: varies by 0\.00 m.*system 3: varies by 0\.00 m"):
        takeoffs(idle.content + flight(system=3, lasts_s=0).content)


def test_a_vehicle_of_which_no_position_is_whole_is_no_reason_either() -> None:
    """Its positions are more, but damaged."""
    damaged = b"".join(
        record[:20] + bytes([record[20] ^ 1]) + record[21:] if record[15] == 32 else record
        for record in frames_of(flight(system=2, lasts_s=20).content)
    )
    (found,) = takeoffs(together(damaged, flight(system=1).content))
    assert same(found, takeoffs(flight(system=1))[0])


def test_vehicles_under_different_autopilots_are_read_as_their_own() -> None:
    found = takeoffs(together(recorded("paparazzi_283_13_82.tlog"), flight(system=1).content))
    assert {each.system: each.gain_names[0] for each in found} == {1: "PSC_POSZ_P", 31: "kp"}


def test_a_changed_system_id_is_said() -> None:
    before, after = flight(system=1), flight(system=4)
    later = Telemetry(ardupilotmega, autopilot=3, system=4)
    later.now_s += 12.0
    for _ in range(5):
        later.heartbeat()
        later.fly(1.0, to_m=0.0)
    (found,) = takeoffs(before.content + later.content)
    assert any("system 4 under ArduPilot; never heard together" in note for note in found.notes)
    together_flown = takeoffs(together(before.content, after.content))
    assert not any("never heard together" in note for each in together_flown for note in each.notes)


@pytest.fixture(scope="module")
def fleet() -> bytes:
    """Altitude steps of vehicle 1, and a longer flight of vehicle 9 that climbs further, but in another mode."""
    climbs = replace(STEPS, set_points=((0.0, 5.0), (5.0, 12.0)), system=9, mode=LOITER, every=1)
    return together(STEPS.content, climbs.content)


def test_the_vehicle_with_the_most_to_learn_is_analysed_whichever_reports_most(fleet: bytes) -> None:
    reader = READERS[Format.TLOG]
    recording = read_tlog(io.BytesIO(fleet))
    assert (recording.system, [each.system for each in recording.others]) == (9, [1])
    chosen = reader.vehicle(recording, "flight.tlog")
    assert (chosen.system, chosen.others) == (1, ())
    found, alone = (reader.flown(each, "flight.tlog") for each in (chosen, read_tlog(io.BytesIO(STEPS.content))))
    assert isinstance(found, LoggedFlight)
    assert isinstance(alone, LoggedFlight)
    assert found.error_m == pytest.approx(alone.error_m, abs=1e-9)
    with pytest.raises(TrajectoryError, match="has no vehicle 3, only 9, 1"):
        reader.vehicle(recording, "flight.tlog", 3)


@pytest.mark.complete
def test_the_analysis_says_that_there_was_another_and_takes_it_on_request(fleet: bytes) -> None:
    answer = analyze_content(fleet, None, "flight.tlog").answer
    assert answer.texts.tuning.notes.count("Another vehicle in the log, system 9 under ArduPilot.") == 1
    other = analyze_content(fleet, None, "flight.tlog", vehicle=9).answer
    assert "other_modes" in [each.code for each in other.tuning.reasons]
    said = " ".join((*other.texts.tuning.reasons, *other.texts.tuning.notes))
    assert said.casefold().count("another vehicle in the log, system 1 under ardupilot") == 1


def recording_of(content: bytes) -> Recording:
    return read_tlog(io.BytesIO(content))


def test_the_date_is_that_of_receipt() -> None:
    """0 s on the vehicle's clock is 100 s before the log begins, 102 s before the takeoff."""
    booted = datetime.fromtimestamp(BEGAN_US / 1e6, UTC)
    assert recording_of(flight().content).started_at == booted
    (flown,) = takeoffs(flight())
    assert flown.began_at is not None
    assert abs((flown.began_at - booted).total_seconds() - 102.0) < 0.1
    assert flown.summary.endswith(", 2026-11-21 00:51 UTC")


@pytest.mark.parametrize("began_us", [0, 300_000_000, 4_000_000_000_000_000], ids=["1970", "after boot", "2096"])
def test_a_ground_station_without_a_clock_gives_no_date_and_the_same_flight(began_us: int) -> None:
    def unset(log: Telemetry) -> None:
        log.began_us = began_us

    log = flight(written=unset)
    assert recording_of(log.content).started_at is None
    assert same(takeoffs(log)[0], takeoffs(flight())[0])
    assert "UTC" not in takeoffs(log)[0].summary


def test_a_clock_that_is_set_while_it_records_dates_the_beginning() -> None:
    records = frames_of(flight().content)
    content = b"".join(
        record if place > 100 else struct.pack(">Q", int.from_bytes(record[:8], "big") - BEGAN_US) + record[8:]
        for place, record in enumerate(records)
    )
    found, known = recording_of(content).started_at, recording_of(flight().content).started_at
    assert found is not None
    assert known is not None
    assert abs((found - known).total_seconds()) < 0.1
    assert same(takeoffs(content)[0], takeoffs(flight())[0])


def test_a_clock_that_is_set_while_the_vehicle_restarts_is_no_time_in_which_it_was_off() -> None:
    log = Telemetry(ardupilotmega, autopilot=3, system=1)
    log.began_us = 0
    log.heartbeat()
    log.fly(60.0, to_m=0.0, rate_hz=5.0)
    log.began_us, log.booted_s = BEGAN_US, log.now_s
    log.fly(5.0, to_m=0.0)
    log.fly(5.0, to_m=3.0)
    (found,) = takeoffs(log)
    assert found.start_s == pytest.approx(86_400.0 + 65.0, abs=1.0)


@pytest.mark.parametrize("delay_s", [0.0, 0.04, 0.8, 1.6])
def test_frames_that_come_again_over_a_slower_link_change_nothing(delay_s: float) -> None:
    def arms_late(log: Telemetry) -> None:
        log.booted_s = log.now_s - 0.2

    def sparse() -> Telemetry:
        return flight(rate_hz=10.0, written=arms_late)

    delayed = [
        struct.pack(">Q", int.from_bytes(record[:8], "big") + round(1e6 * delay_s)) + record[8:]
        for record in frames_of(sparse().content)
    ]
    (found,) = takeoffs(together(sparse().content, b"".join(delayed)))
    assert same(found, takeoffs(sparse())[0])
    assert found.notes == takeoffs(sparse())[0].notes


def test_both_versions_of_the_protocol_in_one_log_are_read() -> None:
    older, newer = frames_of(flight(dialect=mavlink_1).content), frames_of(flight().content)
    mixed = b"".join(pair[place % 2] for place, pair in enumerate(zip(older, newer, strict=True)))
    assert {record[8] for record in frames_of(mixed)} == {0xFE, 0xFD}
    assert same(takeoffs(mixed)[0], takeoffs(flight())[0])


def test_signed_frames_are_read() -> None:
    def sign(log: Telemetry) -> None:
        for address in ((1, 1), (255, 190)):
            signing = log.sender(address).signing
            signing.secret_key, signing.sign_outgoing, signing.timestamp = b"k" * 32, True, 1

    log = flight(written=sign)
    assert log.content[10] == 1
    assert same(takeoffs(log)[0], takeoffs(flight())[0])


@pytest.mark.parametrize("cut", [1, 7, 9, 20, 35])
def test_a_log_cut_in_a_frame_at_either_end_is_read(cut: int) -> None:
    whole = flight().content
    for content in (whole[cut:], whole[:-cut]):
        assert recognise(content[:HEAD_BYTES]) is Format.TLOG
        (found,) = takeoffs(content)
        assert found.trajectory["altitude_m"].max() == pytest.approx(3.0, abs=0.01)


@pytest.mark.parametrize("name", ["flight.tlog", "flight.bin", "flight.csv"])
def test_a_file_of_zeros_is_refused_as_one(name: str) -> None:
    with pytest.raises(TrajectoryError, match="nothing but zeros"):
        read_takeoffs(io.BytesIO(bytes(100_000)), name=name)
    with pytest.raises(TrajectoryError, match="nothing but zeros"):
        analyze_content(bytes(100_000), None, name)


def test_zeros_within_a_log_cost_what_they_replace() -> None:
    whole = bytearray(flight().content)
    whole[12_000:16_096] = bytes(4096)
    whole += bytes(10_000)
    (found,) = takeoffs(bytes(whole))
    assert found.trajectory.time_s[-1] == pytest.approx(10.0, abs=0.05)


def test_a_takeoff_with_too_few_samples_is_refused_with_their_number() -> None:
    with pytest.raises(TrajectoryError) as refused:
        takeoffs(flight(rate_hz=4.0, waits_s=5, lasts_s=3))
    assert refused.value.message == "The log contains no takeoff with at least 20 samples."
    assert [each.reason for each in refused.value.problems] == ["has 17 samples of the takeoff 4.8 s into the log"]


@pytest.mark.parametrize(
    ("kind", "frame"),
    [(1, "plane"), (4, "helicopter"), (10, "rover"), (20, "VTOL"), (22, "VTOL"), (5, "tracker"), (8, "other")],
)
def test_what_is_no_copter_is_named_by_its_heartbeats(kind: int, frame: str) -> None:
    """The first one, before the frame is configured, says nothing."""
    log = Telemetry(ardupilotmega, autopilot=3, system=1)
    for each in (0, kind, kind):
        log.vehicle("heartbeat", each, 3, 0, 0, 4)
        log.fly(1.0, to_m=0.0)
    assert recording_of(log.content).frame == frame
    assert frame in OTHER_FRAMES


@pytest.mark.parametrize(("kind", "frame"), [(2, "quadrotor"), (13, "hexarotor"), (43, ""), (0, "")])
def test_a_copter_is_named_by_its_heartbeats_and_a_vehicle_that_does_not_tell_may_be_one(kind: int, frame: str) -> None:
    """Seen: a vehicle of the generic kind was refused as one of another kind."""
    flown = replace(STEPS, kind=kind)
    assert frame_of(recording_of(flown.content)) == frame
    assert copter_steps(recording_of(flown.content), "flight.tlog") is not None


def test_its_parameters_tell_more_than_its_heartbeats() -> None:
    heli = replace(STEPS, parameters={**STEPS.parameters, "H_SWASH_TYPE": 1.0})
    assert frame_of(recording_of(heli.content)) == "helicopter"
