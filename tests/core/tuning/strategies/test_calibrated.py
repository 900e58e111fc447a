"""Calibrated proposals on vehicles whose optimum is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.autopilots.registry import EXPERIMENTS
from app.core.definition import Definition, Flight, Interval, Prediction, StopRule
from app.core.formatting import short
from app.core.policy import Box
from app.core.records.trajectory import Trajectory
from app.core.tuning.calibration import calibrate
from app.core.tuning.campaign_models import find_robust_optimum
from app.core.tuning.predictions import predict_flight, remaining_biases
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategies.calibrated import CALIBRATED, propose
from app.core.tuning.strategy import Proposal
from bench.predictions import prediction_of
from tests.core.tuning.bowl import QuadraticExperiment
from tests.core.tuning.bowl import fly as fly_bowl
from tests.core.tuning.defined import evidence, next_proposal
from tests.core.tuning.flying import ARDRONE, TAKEOFF, TWIN, compiled_only, fly

SPACE = TAKEOFF.space
DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
CALM = Definition(strategy="calibrated", stop=StopRule(kind="budget"))
HEAVY = (0.74, 0.1, 0.08, 0.2, 0.3, 0.1, 0.01, 0.01)


def told(flight: Flight, proposal: Proposal) -> Flight:
    return replace(flight, predicted=prediction_of(proposal))


def without_thrust(flight: Flight) -> Flight:
    record = flight.trajectory
    return replace(flight, trajectory=Trajectory(record.time_s, {"altitude_m": record["altitude_m"]}, "csv", "vehicle"))


def test_it_is_the_first_that_is_offered() -> None:
    assert next(iter(STRATEGIES)) == "calibrated"


def test_it_refuses_an_experiment_that_it_is_not_made_for() -> None:
    with pytest.raises(TypeError, match="does not work with bowl"):
        propose(evidence(CALM, QuadraticExperiment(), [fly_bowl(1, 30.0, 40)]))


@compiled_only
@pytest.mark.parametrize(
    ("truth", "optimum"),
    [(TWIN, 0.1181), (ARDRONE, 0.0910), ((0.52, 0.1, 0.08, 0.3, 0.0, 0.0, 0.0, 0.0), None), (HEAVY, None)],
)
def test_the_second_flight_is_within_5_percent_of_the_optimum(truth: tuple[float, ...], optimum: float | None) -> None:
    """The twin's optimum was measured once with the original loop; the others' are searched here on the vehicle."""
    box, model = Box(SPACE.lower, SPACE.upper), np.array([truth])
    best = find_robust_optimum(TAKEOFF, box, model, np.array([[1600.0, 1023, 130], [3500, 1040, 220]]))
    lowest = min(filter(None, (optimum, float(TAKEOFF.errors(TAKEOFF.outputs(best[np.newaxis], model[0]))[0]))))
    flights = [fly(1, DEFAULT, truth)]
    proposal = next_proposal(CALM, flights)
    assert proposal.kind == "step"
    second = fly(2, proposal.gains, truth)
    assert second.error is not None
    assert second.error < 1.05 * lowest
    assert proposal.interval is not None
    assert second.error in proposal.interval


@compiled_only
def test_a_proposal_explains_itself() -> None:
    first = fly(1, DEFAULT)
    proposal = next_proposal(CALM, [first])
    why = proposal.explanation
    assert why.base_flight == 1
    assert "calibrated on 1 flight" in why.summary
    assert first.error is not None
    assert proposal.predicted_error is not None
    share = 1.0 - proposal.predicted_error / first.error
    assert f"predicts {short(proposal.predicted_error)} m (90\u00a0% interval" in why.summary
    assert f"{100.0 * share:.0f}\u00a0% less error than flight 1 (" in why.summary
    assert [one.name for one in why.fitted] == [parameter.name for parameter in TAKEOFF.model_parameters]
    assert why.fitted[0].value == pytest.approx(0.61, abs=0.01)
    assert why.gradient["ki"] < 0.0
    assert why.trust_fraction == 1.0
    assert why.lesson
    assert proposal.predicted is not None
    lower, upper = (proposal.predicted[f"altitude_m_{edge}"] for edge in ("lower", "upper"))
    assert (lower <= proposal.predicted["altitude_m"]).all()
    assert (proposal.predicted["altitude_m"] <= upper).all()
    flown = fly(2, proposal.gains).trajectory
    inside = (lower <= flown["altitude_m"]) & (flown["altitude_m"] <= upper)
    assert inside.mean() > 0.8


@compiled_only
def test_once_the_models_optimum_is_flown_nothing_better_is_offered() -> None:
    flights = [fly(1, DEFAULT)]
    while (proposal := next_proposal(CALM, flights)).kind != "none":
        flights.append(told(fly(len(flights) + 1, proposal.gains), proposal))
        assert len(flights) < 6
    best = min(flights, key=lambda flight: flight.error or np.inf)
    assert proposal.gains == best.gains
    assert "no allowed gains that are better" in proposal.explanation.summary


@compiled_only
def test_the_trust_region_bounds_the_step_after_an_abort_and_after_a_prediction_that_failed() -> None:
    first = fly(1, DEFAULT)
    free = next_proposal(CALM, [first])
    aborted = replace(fly(2, free.gains), outcome="aborted", error=None)
    careful = next_proposal(CALM, [first, aborted])
    assert careful.explanation.trust_fraction == 0.5
    assert max(SPACE.change(careful.gains, DEFAULT).values()) <= 0.5
    assert careful.explanation.clipped
    assert careful.explanation.summary.endswith(
        "Flight 2 counted against the gains and halved the largest allowed step: now 50\u00a0% of each gain's range."
    )
    missed = replace(
        fly(2, {"kp": 290, "ki": 15, "kd": 82}),
        predicted=Prediction(error=0.1, interval=Interval(lower=0.09, upper=0.11)),
    )
    after = next_proposal(CALM, [first, missed])
    assert after.explanation.trust_fraction == 0.5
    assert max(SPACE.change(after.gains, missed.gains).values()) <= 0.5


@compiled_only
def test_gains_that_were_aborted_are_not_proposed_again() -> None:
    """Also once a prediction that held has opened the trust region again: then the step is halved."""
    space = SPACE.narrowed({"kp": (400, 500), "ki": (50, 90), "kd": (90, 100)})
    first = fly(1, {"kp": 400, "ki": 50, "kd": 90})
    proposal = propose(evidence(CALM, TAKEOFF, [first], space))
    assert proposal.kind == "step"
    aborted = replace(fly(2, proposal.gains), outcome="aborted", error=None)
    held = replace(fly(3, first.gains), predicted=Prediction(error=0.5, interval=Interval(lower=0.0, upper=1.0)))
    again = propose(evidence(CALM, TAKEOFF, [first, aborted, held], space))
    assert again.explanation.trust_fraction == 1.0
    assert again.kind == "shorter step"
    assert again.gains != proposal.gains
    assert "aborted before" in again.explanation.notes[0]


@compiled_only
def test_gains_that_an_operator_aborted_out_of_caution_are_proposed_again() -> None:
    first = fly(1, DEFAULT)
    free = next_proposal(CALM, [first])
    cautious = [
        replace(fly(number, free.gains), outcome="aborted", error=None, against_gains=False) for number in (2, 3, 4)
    ]
    again = next_proposal(CALM, [first, *cautious])
    assert again.gains == free.gains
    assert again.explanation.trust_fraction == 1.0


@compiled_only
def test_gains_that_flew_worse_than_the_best_are_not_flown_again_however_good_they_look() -> None:
    space = SPACE.narrowed({"kp": (400, 500), "ki": (50, 90), "kd": (90, 100)})
    first = fly(1, {"kp": 400, "ki": 50, "kd": 90})
    unlucky = replace(fly(2, propose(evidence(CALM, TAKEOFF, [first], space)).gains), error=2.0)
    again = propose(evidence(CALM, TAKEOFF, [first, unlucky], space))
    assert (again.kind, again.gains) == ("none", first.gains)


@compiled_only
def test_a_step_of_one_count_that_was_aborted_leaves_nothing_to_halve() -> None:
    space = SPACE.narrowed({"kp": (283, 283), "ki": (0, 1), "kd": (82, 82)})
    first = fly(1, {"kp": 283, "ki": 0, "kd": 82})
    assert propose(evidence(CALM, TAKEOFF, [first], space)).gains["ki"] == 1
    aborted = replace(fly(2, {"kp": 283, "ki": 1, "kd": 82}), outcome="aborted", error=None)
    held = replace(fly(3, first.gains), predicted=Prediction(error=0.5, interval=Interval(lower=0.0, upper=1.0)))
    assert propose(evidence(CALM, TAKEOFF, [first, aborted, held], space)).kind == "none"


@compiled_only
def test_what_the_gate_refuses_is_not_proposed() -> None:
    """Below the lowest ceiling that a definition may have, no gains pass: every one that takes off rises above it."""
    refused = next_proposal(replace(CALM, ceiling_m=2.0), [fly(1, DEFAULT)])
    assert (refused.kind, refused.gains) == ("none", DEFAULT)
    assert "refused by the gate" in refused.explanation.notes[0]


@compiled_only
def test_pinned_gains_and_narrow_bounds_are_kept() -> None:
    space = SPACE.narrowed({"kd": (82, 82), "ki": (0, 200)})
    proposal = propose(evidence(CALM, TAKEOFF, [fly(1, DEFAULT)], space))
    assert proposal.gains["kd"] == 82
    assert proposal.gains["ki"] <= 200
    assert proposal.explanation.gradient["kd"] == 0.0
    assert {"ki", "kd"} <= set(proposal.explanation.clipped)


@compiled_only
@settings(max_examples=5, suppress_health_check=list(HealthCheck))
@given(
    hover=st.floats(0.45, 0.75),
    latency=st.floats(0.0, 0.4),
    lag=st.floats(0.0, 0.1),
    jitter=st.integers(0, 2**32 - 1),
    flown=st.integers(1, 3),
)
@pytest.mark.complete
def test_the_same_history_gives_the_same_proposal_bit_for_bit(
    hover: float, latency: float, lag: float, jitter: int, flown: int
) -> None:
    """Also when the trajectories come with more digits than are stored, and from other objects."""
    truth = (hover, latency, lag, 0.1, 0.0, 0.0, 0.0, 0.0)
    gains = [DEFAULT, {"kp": 1500, "ki": 900, "kd": 150}, {"kp": 800, "ki": 500, "kd": 120}]
    stored = [fly(number, gains[number - 1], truth) for number in range(1, flown + 1)]
    generator = np.random.default_rng(jitter)
    fresh = [
        replace(
            flight,
            trajectory=replace(
                flight.trajectory,
                channels={
                    name: values * (1.0 + 1e-10 * generator.normal(size=len(values)))
                    for name, values in flight.trajectory.channels.items()
                },
            ),
        )
        for flight in stored
    ]
    one, other = next_proposal(CALM, stored), next_proposal(CALM, fresh)
    assert one.predicted is not None
    assert other.predicted is not None
    assert replace(one, predicted=None) == replace(other, predicted=None)
    for channel, values in one.predicted.channels.items():
        assert values.tobytes() == other.predicted[channel].tobytes()


@compiled_only
def test_the_robust_optimum_prefers_what_is_safe_on_every_plausible_model() -> None:
    """The merit is the mean error where nothing is unsafe, and worse by what is."""
    models = np.array([TWIN, HEAVY])
    gains = np.array([[1500.0, 1000, 170], [283, 13, 82], [4000, 1073, 0]])
    merits = TAKEOFF.merits(gains, models, until_s=32.0)
    errors = np.array([TAKEOFF.errors(TAKEOFF.outputs(gains, model)) for model in models]).mean(axis=0)
    assert merits[0] == pytest.approx(errors[0], abs=0.002)
    assert merits[1] > errors[1] + 0.1
    assert merits[2] > errors[2] + 0.1


@compiled_only
def test_what_remains_reproduces_the_flight_and_fades_without_a_recorded_command() -> None:
    flight = fly(1, DEFAULT, HEAVY)
    altitude = flight.trajectory["altitude_m"] + 0.05 * np.sin(flight.trajectory.time_s)
    bent = replace(
        flight, trajectory=replace(flight.trajectory, channels={**flight.trajectory.channels, "altitude_m": altitude})
    )
    calibration = calibrate(TAKEOFF, [without_thrust(bent)])
    here, far = SPACE.vector(DEFAULT), np.array([3000.0, 1000, 200])
    near, beyond = remaining_biases(calibration, without_thrust(bent), np.stack((here, far)))
    assert near == pytest.approx(calibration.residual, abs=1e-12)
    assert np.abs(beyond).max() < 1e-6
    recorded = predict_flight(calibrate(TAKEOFF, [flight]), flight, here)
    assert recorded.error == pytest.approx(flight.error, rel=0.05)


def test_it_is_registered_for_the_experiments_whose_model_flights_identify() -> None:
    names = [name for name, experiment in EXPERIMENTS.items() if CALIBRATED.works_with(experiment)]
    assert names == ["takeoff", "altitude-steps", "altitude-steps-ardupilot", "altitude-steps-px4"]
