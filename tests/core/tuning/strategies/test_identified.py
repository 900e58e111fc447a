from dataclasses import replace

import numpy as np
import pytest

from app.core.definition import Definition, Flight, OptionValue, Start, StopRule
from app.core.records.trajectory import Trajectory
from app.core.tuning.corrected_model import uncorrected_model
from app.core.tuning.strategies.identified import identified_model
from app.core.tuning.strategy import Proposal
from app.vehicles.f16 import LOG_NOISE
from tests.core.tuning.defined import evidence, next_proposal
from tests.core.tuning.flying import compiled_only
from tests.core.tuning.strategies.test_identified_model import MODEL, flight
from tests.vehicles.flying import HAND, TRACKING

pytestmark = compiled_only

BEST_ERROR = 0.204716


def definition(seed: int = 50, step_fraction: float = 1.0, **options: OptionValue) -> Definition:
    return Definition(
        experiment="pitch-tracking",
        experiment_options={"perturbation": 0.45, "model_seed": seed},
        strategy="identified",
        options=options,
        start=Start(kind="simplex"),
        stop=StopRule(kind="paper"),
        step_fraction=step_fraction,
    )


def fly(number: int, proposal: Proposal, log_noise: float = 0.0) -> Flight:
    return flight(number, proposal.gains, log_noise)


@pytest.mark.complete
def test_the_second_flight_is_at_the_true_optimum_and_nothing_is_left_after_it() -> None:
    """Seed 1, whose model's optimum is 19.6 times as bad on the truth."""
    campaign = definition(1, fit="least-squares")
    first = fly(1, next_proposal(campaign, []))
    assert first.error is not None
    assert first.error > 10.0 * BEST_ERROR
    proposal = next_proposal(campaign, [first])
    second = fly(2, proposal)
    assert proposal.kind == "step"
    assert second.error == pytest.approx(BEST_ERROR, abs=2e-4)
    assert proposal.predicted_error == pytest.approx(second.error, rel=1e-3)
    assert proposal.interval is not None
    assert second.error is not None
    assert second.error in proposal.interval
    assert "re-identified from flight 1." in proposal.explanation.summary
    assert len(proposal.explanation.fitted) == 19
    assert proposal.explanation.fitted[-1].standard_error < 0.01
    last = next_proposal(campaign, [first, second])
    assert last.kind == "none"
    assert last.gains == second.gains
    assert "flights 1, 2" in last.explanation.summary


def test_with_noisy_logs_the_prediction_counts_the_noise_and_its_band_holds_it() -> None:
    campaign = definition(1)
    first = flight(1, HAND, 1.0)
    proposal = next_proposal(campaign, [first])
    second = fly(2, proposal, 1.0)
    assert proposal.interval is not None
    assert second.error is not None
    assert second.error in proposal.interval
    assert proposal.predicted is not None
    lower, upper = (proposal.predicted[f"pitch_error_rad_{edge}"] for edge in ("lower", "upper"))
    measured = second.trajectory["pitch_error_rad"]
    assert 0.85 < float(np.mean((lower <= measured) & (measured <= upper))) < 0.99
    assert np.mean(upper - lower) == pytest.approx(2 * 1.6449 * LOG_NOISE[1], rel=0.3)


@pytest.mark.complete
def test_the_same_flights_give_the_same_proposal_bit_for_bit() -> None:
    flown = flight(1, HAND)
    fresh = replace(flown, trajectory=flown.trajectory.as_stored())
    one, other = next_proposal(definition(), [flown]), next_proposal(definition(), [fresh])
    assert one.gains == other.gains
    assert one.predicted_error == other.predicted_error


@pytest.mark.complete
def test_a_step_limit_holds_the_optimum_back() -> None:
    proposal = next_proposal(definition(step_fraction=0.1), [flight(1, HAND)])
    space = MODEL.space
    assert proposal.kind == "step"
    assert max(space.change(proposal.gains, HAND).values()) <= 0.1 + 1e-9


def test_without_recorded_states_the_best_stays_and_it_is_said_why() -> None:
    flown = flight(1, TRACKING)
    bare = Trajectory(flown.trajectory.time_s, {"pitch_error_rad": flown.trajectory["pitch_error_rad"]}, "csv", "x")
    proposal = next_proposal(definition(), [replace(flown, trajectory=bare)])
    assert proposal.kind == "none"
    assert proposal.gains == flown.gains
    assert "cannot be identified" in proposal.explanation.summary


def test_its_landscape_is_the_identified_models_and_holds_for_the_truth() -> None:
    campaign, first = definition(1, fit="least-squares"), flight(1, HAND)
    errors = identified_model(evidence(campaign, MODEL, [first])).errors
    for number, gains in enumerate((HAND, TRACKING), start=1):
        truth = flight(number, gains).error
        assert errors(MODEL.space.vector(gains)[np.newaxis])[0] == pytest.approx(truth, rel=0.02)


def test_without_recorded_states_its_landscape_is_the_nominal_models() -> None:
    first = flight(1, HAND)
    bare = Trajectory(first.trajectory.time_s, {"pitch_error_rad": first.trajectory["pitch_error_rad"]}, "csv", "x")
    points = MODEL.space.vector(TRACKING)[np.newaxis]
    unseen = identified_model(evidence(definition(), MODEL, [replace(first, trajectory=bare)])).errors
    assert unseen(points) == pytest.approx(uncorrected_model(MODEL).errors(points))
