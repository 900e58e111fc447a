"""What a log answers, and what it is refused for."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.analysis.analysis import Analysis, Grade, analyze
from app.core.analysis.hover import advise_hover
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.errors import TrajectoryError
from app.core.records.trajectory import Samples
from tests.core.analysis.flights import GUSTY, QUIET, parameters_of, recorded_steps, simulated_flight
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only


def changed(flight: LoggedFlight, **signals: Samples) -> LoggedFlight:
    """The flight with signals of its one segment replaced."""
    (segment,) = flight.segments
    return replace(flight, segments=[replace(segment, **signals)])


def shortened(flight: LoggedFlight, rows: slice) -> LoggedFlight:
    (segment,) = flight.segments
    return changed(flight, **{name: getattr(segment, name)[rows] for name in Segment.__slots__})


def refusal(flight: LoggedFlight) -> str:
    with pytest.raises(TrajectoryError) as refused:
        analyze(flight)
    (problem,) = refused.value.problems
    assert "Fly at a height of 3 m or more" in refused.value.hint
    return problem.code


@pytest.fixture(scope="module")
def found() -> Analysis:
    """What the log of the real binary gives."""
    return analyze(recorded_steps())


def test_the_log_of_the_real_binary_gives_gains_six_times_better(found: Analysis) -> None:
    """SITL flew 4.2 mm with its own proposal from such a flight, and 27 mm with the defaults."""
    assert found.why_none is None
    assert found.proposed is not None
    present = found.assessments[0]
    assert present.name == "As flown"
    assert present.activity == pytest.approx(1.0)
    assert found.proposed.prediction.error_m < present.prediction.error_m / 5.0
    assert found.proposed.margin >= 2.0
    assert found.proposed.activity <= 1.5
    assert found.behaviour.error_m == pytest.approx(0.0275, abs=2e-4)
    assert found.behaviour.reference_range_m == pytest.approx(2.0, abs=0.05)
    assert found.behaviour.saturated_share == 0.0
    assert found.loop.assumed_hover_throttle == pytest.approx(0.39)
    assert {each.name for each in found.assessments[1:]} == set(found.loop.rules(0.363))


def test_the_documented_rule_follows_the_hover_throttle() -> None:
    flight = simulated_flight(QUIET)
    rule = flight.loop.rules(flight.throttle_mean)["P = hover throttle, I = 2 P"]
    assert rule == {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.4, "PSC_ACCZ_I": 0.8}


def test_too_much_gust_for_the_slope_says_what_to_fly() -> None:
    found = analyze(simulated_flight(replace(GUSTY, gust_m_s2=0.8, quadratic=0.4), seed=3))
    assert found.proposed is None
    assert found.why_none is not None
    assert (found.grade, found.why_none.code.key) == (Grade.PARTIAL, "slope_unknown")
    assert found.why_none.numbers["thrust_slope_deviation"] > 0.15
    assert "climb 2 m" in found.answer


def test_the_end_of_a_climb_with_a_hover_is_described_and_answers_nothing() -> None:
    """As a takeoff gives: of SITL's vehicle a slope of 0.97 ± 0.01 and a lag of 12 ± 6 ms, where 1.00 and 0 are true.
    The climb begins after 4 s, and the first 2 s are not scored."""
    found = analyze(shortened(simulated_flight(), slice(35, 105)))
    assert found.proposed is None
    assert found.why_none is not None
    assert found.why_none.code.key == "no_whole_change"
    assert found.estimate.mean.hover_throttle == pytest.approx(QUIET.hover_throttle, abs=0.002)


TURBULENCE = replace(QUIET, gust_m_s2=0.6, gust_s=0.04, noise_m_s2=0.02, assumed_hover_throttle=0.4)
"""As ArduPilot's simulation makes it: gusts shorter than a row of the log."""


@pytest.mark.complete
@pytest.mark.parametrize("seed", [2, 3])
def test_turbulence_within_a_row_is_answered(seed: int) -> None:
    """Taken for noise, such gusts made the model deviate by half as much again as the flight, which was refused."""
    found = analyze(simulated_flight(TURBULENCE, seed=seed))
    assert found.assessments[0].prediction.error_m == pytest.approx(found.behaviour.error_m, rel=0.1)


@pytest.mark.parametrize("factor", [0.6, 2.0])
def test_other_gains_are_refused_in_turbulence_too(factor: float) -> None:
    """A tuning knob changed the gains of the acceleration controller, and not the parameters in the log."""
    flown = simulated_flight(TURBULENCE, seed=2, acceleration_p=0.5 * factor, acceleration_i_1_s=factor)
    logged = flown.loop.with_gains({"PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.0})
    assert refusal(replace(flown, loop=logged)) == "deviation_not_explained"


@pytest.mark.complete
def test_a_vehicle_that_no_gains_suit_is_told() -> None:
    """Motors so strong that they hover at 5 % of the throttle: even the smallest documented gains lack the margin."""
    strong = replace(QUIET, hover_throttle=0.05, assumed_hover_throttle=0.125)
    found = analyze(simulated_flight(strong, acceleration_p=0.05, acceleration_i_1_s=0.1))
    assert found.proposed is None
    assert found.why_none is not None
    assert found.why_none.code.key == "margin_unreachable"


def test_hover_alone_is_refused() -> None:
    flight = simulated_flight(GUSTY)
    (segment,) = flight.segments
    level = np.full_like(segment.z_d_m, 5.0)
    still = np.zeros_like(level)
    hovering = changed(flight, z_d_m=level, v_d_m_s=still, a_d_m_s2=still, z_m=level, v_m_s=still, a_m_s2=still)
    assert refusal(hovering) == "no_altitude_changes"


def test_too_short_a_flight_is_refused() -> None:
    assert refusal(shortened(simulated_flight(), slice(30, 80))) == "too_short"


def test_a_throttle_at_its_limit_is_refused() -> None:
    flight = simulated_flight()
    (segment,) = flight.segments
    throttle = segment.throttle.copy()
    throttle[::8] = 0.0
    assert refusal(changed(flight, throttle=throttle)) == "saturated"


@pytest.mark.parametrize(("signal", "named"), [("a_m_s2", "acceleration"), ("throttle_filtered", "throttle")])
def test_a_signal_that_nobody_recorded_is_refused(signal: str, named: str) -> None:
    flight = simulated_flight()
    (segment,) = flight.segments
    constant = np.full(len(segment.time_s), 0.4)
    with pytest.raises(TrajectoryError, match=f"has a constant {named}: nothing can be learned from it"):
        analyze(changed(flight, **{signal: constant}))


def test_another_controller_is_refused() -> None:
    flight = simulated_flight()
    (segment,) = flight.segments
    assert refusal(changed(flight, v_t_m_s=segment.v_t_m_s + 0.1)) == "other_controller"


def test_accelerations_that_nothing_explains_are_refused() -> None:
    """As of oscillating rate controllers: 3 m/s² at 3 Hz beside what the throttle does."""
    flight = simulated_flight()
    (segment,) = flight.segments
    shaken = segment.a_m_s2 + 3.0 * np.sin(2.0 * np.pi * 3.0 * segment.time_s)
    assert refusal(changed(flight, a_m_s2=shaken)) == "unexplained_accelerations"


def test_a_flight_that_the_model_does_not_repeat_is_refused() -> None:
    """A reference that was another than logged: the altitude beside it is not what the loop would have done."""
    flight = simulated_flight()
    (segment,) = flight.segments
    off = segment.z_d_m + 0.1
    moved = changed(flight, z_d_m=off, v_t_m_s=segment.v_t_m_s + 0.1 * parameters_of(flight).position_p_1_s)
    assert refusal(moved) == "deviation_not_explained"


def stiff_flight(acceleration_p: float) -> LoggedFlight:
    """3, 8 and an integral gain of 3 on a vehicle with fast motors, in gusts."""
    nimble = replace(GUSTY, motor_lag_s=0.02, assumed_hover_throttle=0.4)
    return simulated_flight(
        nimble, position_p_1_s=3.0, velocity_p_1_s=8.0, acceleration_p=acceleration_p, acceleration_i_1_s=3.0
    )


@pytest.mark.complete
def test_good_gains_are_kept() -> None:
    found = analyze(stiff_flight(0.8))
    assert found.assessments[0].margin > 2.0
    assert found.proposed is None
    assert found.answer.startswith("Keep the gains flown")
    assert found.parameter_file("flight.bin") is None
    advice = advise_hover(found.loop, 0.5)
    assert advice is not None
    lines = (replace(found, hover=advice).parameter_file("flight.bin") or "").splitlines()
    assert lines[1:] == [f"# {advice.reason}", "# MOT_THST_HOVER was 0.4", "MOT_THST_HOVER,0.5"]


@pytest.mark.complete
def test_gains_that_lack_the_margin_are_answered_by_some_that_have_it() -> None:
    found = analyze(stiff_flight(1.2))
    assert found.assessments[0].margin < 2.0
    assert found.proposed is not None
    assert found.proposed.margin >= 2.0
    margin = f"{found.proposed.margin:.1f}"
    assert f"about the same for the proposed gains, with a margin of {margin} instead of 1.8" in found.answer


def test_the_answer_tells_what_was_measured_and_what_is_predicted(found: Analysis) -> None:
    assert found.proposed is not None
    low, high = (f"{1e3 * each:.1f}" for each in (found.proposed.prediction.low_m, found.proposed.prediction.high_m))
    assert found.answer == (
        f"Mean deviation: 27.4 mm measured. The model predicts {1e3 * found.assessments[0].prediction.error_m:.1f} mm "
        f"for the gains flown, and {1e3 * found.proposed.prediction.error_m:.1f} mm ({low} … {high} mm) for the "
        "proposed ones."
    )
    assert {"PSC_POSZ_P", "PSC_VELZ_P"} <= set(found.at_limit)
    lines = (found.parameter_file("steps.bin") or "").splitlines()
    assert lines[0].startswith("# Gainline, from steps.bin. Load on the ground")
    assert lines[1] == "# PSC_POSZ_P was 1"
    assert lines[-4:] == [f"{name},{value:g}" for name, value in found.proposed.gains.items()]


@pytest.mark.complete
def test_among_gains_that_deviate_alike_those_with_more_margin_are_proposed() -> None:
    """On the binary's vehicle 3, 8, 0.85, 3 has the least deviation, at a margin of 2.0; 3, 8, 0.5, 3 deviates 0.1 mm
    more."""
    found = analyze(recorded_steps())
    stiff = next(each for each in found.assessments if each.name == "For comparison: 3, 8, 0.5, 3")
    assert found.proposed is not None
    assert found.proposed.prediction.error_m < 1.05 * stiff.prediction.error_m
    assert found.proposed.margin >= stiff.margin > 3.0
