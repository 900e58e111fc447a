"""What recordings of every kind give for the description of their flight, and the loop with their gains."""

import io
from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.logged_flight import ardupilot_flight
from app.autopilots.described import loop_of, signals_of
from app.autopilots.px4.log import read_px4
from app.autopilots.recording import Recording
from app.autopilots.tlog import read_tlog
from app.core.analysis.description import Description, describe
from app.core.analysis.hand_rules import usual_margins
from app.core.analysis.loop import LoggedFlight
from tests.core.analysis.flights import QUIET, simulated_flight
from tests.core.analysis.px4_flights import simulated_px4
from tests.logs.written import GUIDED, LANDED, NEWER_PARAMETERS, NOT_LANDED, PARAMETERS, STABILIZE, ardupilot_log
from tests.logs.written_px4 import px4_log
from tests.logs.written_tlog import GROUND_STATION
from tests.logs.written_tlog import Recording as Telemetry


def copter(content: bytes) -> Recording:
    return read_ardupilot(io.BytesIO(content))


def described(recording: Recording) -> Description:
    signals = signals_of(recording)
    assert signals is not None
    found = describe(signals)
    assert found is not None
    return found


def oscillating(frequency_hz: float, amplitude_m: float) -> LoggedFlight:
    """40 s of hover at 5 m about which the altitude oscillates."""
    flight = simulated_flight(QUIET)
    (segment,) = flight.segments
    time_s = np.arange(0.0, 40.0, 0.1)
    rows = {name: np.resize(getattr(segment, name)[20:40], len(time_s)) for name in type(segment).__slots__}
    wave = amplitude_m * np.sin(2.0 * np.pi * frequency_hz * time_s)
    still = {name: np.zeros_like(time_s) for name in ("v_m_s", "a_m_s2", "v_d_m_s", "a_d_m_s2", "v_t_m_s")}
    altitudes = {"z_m": 5.0 + wave, "z_d_m": np.full_like(time_s, 5.0)}
    return replace(flight, segments=[replace(segment, **{**rows, **still, **altitudes, "time_s": time_s})])


def test_an_oscillation_of_a_hover_is_found_in_its_log() -> None:
    found = described(copter(ardupilot_log(oscillating(0.6, 0.15))))
    assert found.oscillation is not None
    assert found.oscillation.frequency_hz == pytest.approx(0.6, rel=0.02)
    assert found.oscillation.amplitude_m == pytest.approx(0.15, rel=0.05)
    assert found.hover_throttle == pytest.approx(0.4, abs=0.005)
    assert found.searched_s > 35.0


@pytest.mark.parametrize("kind", ["bin", "ulg", "tlog", "slow", "ground station"])
def test_every_kind_of_log_tells_the_hover_throttle_and_the_deviation(kind: str) -> None:
    """The simulated vehicles hover at 0.4; a slow telemetry log has four messages a second, and that of a ground
    station which asks for the position above home alone other ones."""
    recordings = {
        "bin": lambda: copter(ardupilot_log(simulated_flight(QUIET))),
        "ulg": lambda: read_px4(io.BytesIO(px4_log(simulated_px4()))),
        "tlog": lambda: read_tlog(io.BytesIO(Telemetry().content)),
        "slow": lambda: read_tlog(io.BytesIO(replace(Telemetry(), every=12).content)),
        "ground station": lambda: read_tlog(io.BytesIO(Telemetry(every=12, sends=GROUND_STATION).content)),
    }
    found = described(recordings[kind]())
    assert found.hover_throttle == pytest.approx(0.4, abs=0.01)
    assert found.deviation_mean_m is not None
    assert 0.005 < found.deviation_mean_m < 0.05
    assert found.held_s > 12.0


def test_logs_have_the_sensed_acceleration_and_the_parameter_for_hover_and_telemetry_the_parameter_alone() -> None:
    recordings = (
        copter(ardupilot_log(simulated_flight(QUIET))),
        read_px4(io.BytesIO(px4_log(simulated_px4()))),
        read_tlog(io.BytesIO(Telemetry().content)),
    )
    signals = [each for each in map(signals_of, recordings) if each is not None]
    assert [each.assumed_hover for each in signals] == pytest.approx([0.35, 0.35, 0.35])
    assert [bool(np.isfinite(each.sensed_m_s2).all()) for each in signals] == [True, True, False]
    assert np.corrcoef(signals[1].sensed_m_s2, np.gradient(signals[1].climb_rate_m_s))[0, 1] > 0.5


def test_manual_modes_and_the_ground_are_not_held_and_not_flown() -> None:
    log = ardupilot_log(
        simulated_flight(QUIET),
        modes=((0.0, GUIDED), (15.0, STABILIZE)),
        events=((0.0, NOT_LANDED), (20.0, LANDED)),
    )
    found = described(copter(log))
    assert (found.flown_s, found.held_s) == pytest.approx((10.0, 5.0), abs=0.21)


def test_a_recording_without_an_altitude_has_no_signals() -> None:
    recording = copter(ardupilot_log(simulated_flight(QUIET)))
    without = {name: column for name, column in recording.columns.items() if name != "altitude_m"}
    assert signals_of(replace(recording, columns=without)) is None


def test_the_loop_has_the_gains_of_the_time_by_the_names_of_the_release() -> None:
    changes = ((15.0, "PSC_ACCZ_P", 0.8),)
    recording = copter(ardupilot_log(simulated_flight(QUIET), changes=changes))
    gains = [loop.gains["PSC_ACCZ_P"] for at_s in (15.0, 25.0) if (loop := loop_of(recording, at_s, 0.4)) is not None]
    assert gains == pytest.approx([0.5, 0.8])
    newer = loop_of(copter(ardupilot_log(simulated_flight(QUIET), parameters=NEWER_PARAMETERS)), 20.0, 0.4)
    assert newer is not None
    assert usual_margins(newer, 0.4).sets[0].gains["PSC_D_ACC_P"] == pytest.approx(0.05)


def test_there_is_no_loop_without_its_gains_or_with_what_a_replica_lacks() -> None:
    flight = simulated_flight(QUIET)
    without = {name: value for name, value in PARAMETERS.items() if name != "PSC_ACCZ_I"}
    for parameters in (without, {**PARAMETERS, "PSC_ACCZ_SMAX": 5.0}):
        assert loop_of(copter(ardupilot_log(flight, parameters=parameters)), 20.0, 0.4) is None


@pytest.mark.parametrize("events", [(), ((20.0, LANDED),), ((15.0, NOT_LANDED),)])
def test_a_log_that_begins_in_the_air_is_described_by_the_rule_of_the_analysis(
    events: tuple[tuple[float, int], ...],
) -> None:
    """The part that is analysed begins some seconds after each event, and ends some before."""
    recording = copter(ardupilot_log(simulated_flight(QUIET), events=events))
    (segment,) = ardupilot_flight(recording, "flight.bin").segments
    found = described(recording)
    assert segment.duration_s <= found.held_s + 0.11 <= segment.duration_s + 3.3


def test_a_biased_climb_rate_does_not_hide_that_the_vehicle_is_at_rest() -> None:
    flight = simulated_flight(QUIET)
    (segment,) = flight.segments
    biased = replace(flight, segments=[replace(segment, v_m_s=segment.v_m_s - 0.35)])
    assert described(copter(ardupilot_log(biased))).hover_throttle == pytest.approx(0.4, abs=0.01)
