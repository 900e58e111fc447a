"""What ArduCopter's releases of all times answer: each format, of steps, of a takeoff alone, and of plain flight.

What the binary of 4.7 flew is written in the columns, units and names of each release; so the motion of takeoffs and
plain flights before 4.1 is borrowed from a later loop. Steps of 3.3 to 4.0 are flown by a loop of their own
(`copter_motions`)."""

import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.logged_flight import ardupilot_flight
from app.core.analysis.analysis import Grade, is_alike
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.prediction import FlightModel
from app.core.analysis.vehicle_fit import fit_copter
from app.core.errors import InputError
from app.log_library.content import analyze_content
from app.log_library.schemas import LogAnswer, ManoeuvreNumbers
from tests.logs.copter_motions import OLDER, TRUTH, Motion, flown, older_steps
from tests.logs.written_releases import CTUN, RELEASES, Release

TUNED_BY_CTUN = ("3.4", "3.6", "4.0")
LATER = ("4.1", "4.2", "4.6", "4.7")
OWN_NAMES = {
    "3.4": ["POS_Z_P", "VEL_Z_P", "ACCEL_Z_P", "ACCEL_Z_I"],
    "3.6": ["PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_I"],
    "4.7": ["PSC_D_POS_P", "PSC_D_VEL_P", "PSC_D_ACC_P", "PSC_D_ACC_I"],
}
NO_CLOCK = """ArduCopter V3.0.1 (0a1b2c3d)
FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns
FMT, 4, 21, CTUN, hcefhhhhh, ThrIn,SonAlt,BarAlt,WPAlt,NavThr,AngBst,CRate,ThrOut,DCRate
CTUN, 500, 0.00, 3.00, 3.00, 0, 0, 0, 402, 0
"""


@cache
def motion(kind: str, release: str = "4.7") -> Motion:
    """The flight of a release; plain flight is that at one altitude."""
    if kind == "takeoff":
        return flown("arducopter_takeoff")
    if kind == "plain":
        return flown("arducopter_lateral_steps").between(60.0, 90.0)
    return older_steps() if release < "4.1" else flown("arducopter_steps")


def read(content: bytes) -> LoggedFlight:
    return ardupilot_flight(read_ardupilot(io.BytesIO(content)), "flight.bin")


def refusal(content: bytes) -> list[tuple[str, str]]:
    with pytest.raises(InputError) as refused:
        read(content)
    return [(each.field, each.code) for each in refused.value.problems]


def answered(content: bytes) -> LogAnswer:
    return analyze_content(content, None, "flight.bin").answer


KINDS = ("steps", "takeoff", "plain")
EXPECTED = {
    **{(name, kind): ("column_missing", "CTUN.ThI") for name in ("3.1", "3.3") for kind in KINDS},
    **{(name, "takeoff"): ("too_short", "file") for name in (*TUNED_BY_CTUN, *LATER)},
    **{(name, "plain"): ("no_altitude_changes", "file") for name in (*TUNED_BY_CTUN, *LATER)},
}


@pytest.mark.parametrize(
    ("release", "kind"),
    [
        pytest.param(*each, marks=[pytest.mark.complete] if each[0] in ("4.0", "4.2", "4.6") else [])
        for each in EXPECTED
    ],
)
def test_flights_that_do_not_suffice_are_described_and_say_why(release: str, kind: str) -> None:
    """Hover throttle and deviation are those of the recorded flights. The gains before 3.3 are of another loop: without
    them there are no margins."""
    found = answered(RELEASES[release].log(motion(kind, release)))
    assert found.release is not None
    assert found.release.startswith(release)
    assert [(each.code, each.field) for each in found.tuning.reasons] == [EXPECTED[release, kind]]
    assert found.tuning.grade is (Grade.DESCRIPTION if release == "3.1" else Grade.PARTIAL)
    described = found.tuning.description
    assert described is not None
    hover = TRUTH["hover_throttle"] if kind == "steps" else 0.365
    assert described.hover_throttle == pytest.approx(hover, abs=0.005)
    deviation_m, within_m = {"steps": (0.0195, 0.003), "takeoff": (0.03, 0.001), "plain": (0.0015, 0.001)}[kind]
    assert described.deviation_mean_m == pytest.approx(deviation_m, abs=within_m)
    if release in OWN_NAMES:
        assert found.tuning.numbers is not None
        assert list(found.tuning.numbers.assessments[0].gains) == OWN_NAMES[release]


def test_a_release_without_a_clock_is_refused_as_such() -> None:
    with pytest.raises(InputError) as refused:
        answered(NO_CLOCK.encode())
    assert [each.code for each in refused.value.problems] == ["no_clock"]


def vehicle_of(flight: LoggedFlight) -> dict[str, float]:
    estimate = fit_copter(flight)
    model = FlightModel(flight, estimate.few)
    assert is_alike(flight.error_m, model.predict(flight.loop).error_m)
    assert estimate.mean.thrust_slope == pytest.approx(TRUTH["thrust_slope"], abs=3.0 * estimate.deviation.thrust_slope)
    assert estimate.deviation.thrust_slope < 0.15
    assert estimate.mean.motor_lag_s == pytest.approx(TRUTH["motor_lag_s"], abs=0.04)
    return {"hover_throttle": estimate.mean.hover_throttle}


@pytest.mark.parametrize(
    ("release", "feeds_rate"),
    [
        ("3.4", True),
        ("3.6", False),
        *(pytest.param(*each, marks=pytest.mark.complete) for each in (("3.4", False), ("3.6", True))),
        *(pytest.param("4.0", each, marks=pytest.mark.complete) for each in (True, False)),
    ],
)
def test_steps_until_4_0_give_the_vehicle_its_gains_and_the_error_that_they_predict(
    release: str, feeds_rate: bool
) -> None:
    """In ALT_HOLD, and in GUIDED, where the target moves without a desired climb rate."""
    flight = read(RELEASES[release].log(older_steps(feeds_rate=feeds_rate)))
    assert isinstance(flight.loop, ArduPilotLoop)
    assert flight.loop.differentiates
    assert flight.loop.gains == pytest.approx({name: OLDER[name] for name in flight.loop.gains})
    assert flight.loop.parameters.acceleration_error_filter_hz == pytest.approx(20.0)
    assert list(flight.loop.named(flight.loop.gains)) == OWN_NAMES["3.4" if release == "3.4" else "3.6"]
    assert vehicle_of(flight)["hover_throttle"] == pytest.approx(TRUTH["hover_throttle"], rel=0.01)


@pytest.mark.parametrize("release", LATER)
def test_steps_since_4_1_are_read_as_they_were_flown(release: str) -> None:
    flight = read(RELEASES[release].log(motion("steps")))
    (found,), (expected,) = flight.segments, read(RELEASES["4.7"].log(motion("steps"))).segments
    for name in ("z_m", "v_m_s", "a_m_s2", "z_d_m", "v_d_m_s", "a_d_m_s2", "v_t_m_s", "throttle", "throttle_filtered"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-6), name
    assert isinstance(flight.loop, ArduPilotLoop)
    assert not flight.loop.differentiates
    assert flight.error_m == pytest.approx(0.0234, abs=2e-4)


def test_a_later_log_without_the_loops_own_message_is_read_from_the_others() -> None:
    """Climb rates are cut off at whole cm/s there."""
    whole = RELEASES["4.2"]
    without = replace(whole, messages={name: each for name, each in whole.messages.items() if name != "PSCD"})
    (found,), (expected,) = (read(each.log(motion("steps"))).segments for each in (without, whole))
    for name in ("z_m", "a_m_s2", "z_d_m", "throttle_filtered"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-6), name
    for name in ("v_m_s", "v_d_m_s", "v_t_m_s"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=0.011), name
    assert np.std(found.a_d_m_s2 - expected.a_d_m_s2) < 0.1


def test_where_the_loops_own_message_lacks_most_of_the_flight_the_others_are_read() -> None:
    """As before 4.1.0-beta4 in ALT_HOLD; time on the ground does not count."""
    for until_s, message in ((55.0, "CTUN"), (72.0, "PSCZ")):
        recording = read_ardupilot(io.BytesIO(RELEASES["4.1"].log(motion("steps"), loop_until_s=until_s)))
        assert recording.columns["altitude_m"].source.startswith(message)
    steps = motion("steps")
    disarmed = replace(steps, throttle_filtered=steps.throttle_filtered * (steps.time_s < 55.0))
    recording = read_ardupilot(io.BytesIO(RELEASES["4.1"].log(disarmed, loop_until_s=55.0)))
    assert recording.columns["altitude_m"].source == "PSCZ.PZ"
    assert read(RELEASES["4.1"].log(motion("steps"), loop_until_s=55.0)).error_m == pytest.approx(0.0234, abs=2e-4)


@pytest.mark.parametrize("bias_m_s", [-0.28, pytest.param(0.1, marks=pytest.mark.complete)])
def test_a_biased_climb_rate_is_predicted_with_the_deviation_that_it_causes(bias_m_s: float) -> None:
    """The vehicle stands off its target by bias over POS_Z_P; at rest it is nevertheless known to be."""
    content = RELEASES["3.4"].log(older_steps(bias_m_s=bias_m_s))
    flight = read(content)
    assert flight.error_m > 0.6 * abs(bias_m_s) / OLDER["PSC_POSZ_P"]
    assert vehicle_of(flight)["hover_throttle"] == pytest.approx(TRUTH["hover_throttle"], rel=0.01)
    described = answered(RELEASES["3.3"].log(older_steps(bias_m_s=bias_m_s))).tuning.description
    assert described is not None
    assert described.hover_throttle == pytest.approx(TRUTH["hover_throttle"], rel=0.01)


def test_accelerations_at_another_rate_are_those_between() -> None:
    found, whole = (read(RELEASES["3.6"].log(older_steps(), rate_every=each)).segments[0] for each in (2, 1))
    assert np.std(found.a_m_s2 - whole.a_m_s2[: len(found.a_m_s2)]) < 0.2
    rare = RELEASES["3.6"].log(older_steps(), rate_every=4)
    assert refusal(rare) == [("CTUN", "not_numbers")]


def test_a_demand_beyond_the_limits_of_the_throttle_is_that_limit() -> None:
    throttle = older_steps().throttle.copy()
    throttle[50:53] = -0.2, -4e-7, 1.3
    (found,) = read(RELEASES["3.4"].log(replace(older_steps(), throttle=throttle))).segments
    assert [*found.throttle[found.throttle % 1.0 == 0.0]] == [0.0, 0.0, 1.0]


@pytest.mark.parametrize(("multipliers", "factor"), [("F-----0BBB0BB", 1.0), ("F-----0BBB0--", 100.0)])
def test_climb_rates_have_the_unit_that_the_log_tells(multipliers: str, factor: float) -> None:
    """A letter that is scaled already has its factor once."""
    release = RELEASES["3.6"]
    told = replace(release, scales={**release.scales, "CTUN": multipliers})
    columns = read_ardupilot(io.BytesIO(told.log(older_steps()))).columns
    assert columns["climb_rate_m_s"].values == pytest.approx(factor * older_steps().v_m_s, abs=0.011 * factor)
    scaled = replace(told, messages={**release.messages, "CTUN": ("Qffffffeccfcc", CTUN)})
    motion_cm = replace(older_steps(), v_m_s=older_steps().v_m_s / 100.0, v_t_m_s=older_steps().v_t_m_s / 100.0)
    columns = read_ardupilot(io.BytesIO(scaled.log(motion_cm))).columns
    assert columns["climb_rate_m_s"].values == pytest.approx(older_steps().v_m_s, abs=0.011)


def without(message: str, release: Release = RELEASES["3.6"], **parameters: float) -> bytes:
    kept = {name: each for name, each in release.messages.items() if name != message}
    if message in ("MODE", "CTUN", "RATE"):
        return release.log(older_steps(), parameters=parameters).replace(message.encode(), b"X" + message[1:].encode())
    return replace(release, messages=kept).log(older_steps(), parameters=parameters)


@pytest.mark.parametrize(
    ("content", "reasons"),
    [
        (without("RATE"), [("RATE", "message_missing")]),
        (without("RATE", LOG_BITMASK=1 << 4), [("RATE", "log_bit_unset")]),
        (without("RATE", LOG_BITMASK=1 << 4 | 1), [("RATE", "message_missing")]),
        (without("CTUN", LOG_BITMASK=1 << 5 | 2), [("CTUN", "log_bit_unset")]),
        (without("CTUN", LOG_BITMASK=1 << 4 | 2), [("CTUN", "message_missing")]),
        (without("CTUN", RELEASES["4.0"], LOG_BITMASK=2), [("CTUN", "log_bit_unset")]),
        (without("MODE"), [("MODE", "message_missing")]),
        (
            RELEASES["3.6"].log(older_steps(), parameters={"WPNAV_ACCEL_Z": 0.0}),
            [("WPNAV_ACCEL_Z", "parameter_not_positive")],
        ),
        (RELEASES["3.6"].log(older_steps(), parameters={"H_SW_TYPE": 1.0}), [("file", "not_a_copter")]),
        (
            RELEASES["3.4"].log(replace(older_steps(), gains={**OLDER, "PSC_ACCZ_I": 0.0})),
            [("PSC_ACCZ_I", "parameter_not_positive")],
        ),
    ],
)
def test_a_refusal_names_its_cause(content: bytes, reasons: list[tuple[str, str]]) -> None:
    assert refusal(content) == reasons


def test_a_type_of_frame_is_no_class() -> None:
    """6 as a class is a helicopter; until 3.4 FRAME is the type alone."""
    assert read(RELEASES["3.4"].log(older_steps(), parameters={"FRAME": 6.0})).segments


def test_another_position_gain_than_that_of_the_log_is_noticed() -> None:
    lying = replace(older_steps(bias_m_s=-0.28), gains={**OLDER, "PSC_POSZ_P": 1.0})
    found = answered(RELEASES["3.6"].log(lying)).tuning
    assert [each.code for each in found.reasons] == ["other_controller"]


def manoeuvre(content: bytes) -> ManoeuvreNumbers:
    found = answered(content).tuning
    assert found.grade is Grade.FULL
    assert isinstance(found.numbers, ManoeuvreNumbers)
    return found.numbers


@pytest.mark.complete
@pytest.mark.parametrize("release", [*TUNED_BY_CTUN, *LATER])
def test_steps_are_answered_in_full_by_the_vehicles_own_names(release: str) -> None:
    found = manoeuvre(RELEASES[release].log(motion("steps", release)))
    assert found.proposed is not None
    names = OWN_NAMES.get(release, OWN_NAMES["3.6"])
    assert all(list(each.gains) == names for each in (*found.assessments, found.proposed))


@pytest.mark.complete
@pytest.mark.parametrize("feeds_rate", [True, False])
def test_proposed_gains_until_4_0_deviate_as_predicted(feeds_rate: bool) -> None:
    """Flown again with them, in the same weather."""
    proposed = manoeuvre(RELEASES["3.6"].log(older_steps(feeds_rate=feeds_rate))).proposed
    assert proposed is not None
    again = older_steps(feeds_rate=feeds_rate, gains=tuple(proposed.gains.items()))
    assert proposed.low_m <= again.between(26.0, 44.0).error_m <= proposed.high_m
