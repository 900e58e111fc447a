"""The gradient strategy where its answer is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.definition import Definition
from app.core.experiments.base import Check, Envelope, ParameterDistribution
from app.core.policy import Vector
from app.core.tuning.corrected_model import correct_by_bias
from app.core.tuning.gate import check_policy
from app.core.tuning.strategies.gradient import RAW_LADDER, SCALED_LADDER, gradient, longest_step, propose
from tests.core.tuning.bowl import QuadraticExperiment, fly
from tests.core.tuning.defined import evidence

BOWL = QuadraticExperiment()
SPACE = QuadraticExperiment.space


def test_the_ladders_are_the_methods() -> None:
    """Scaled 2³ … 2⁻¹², raw 1 … 1000 counts."""
    assert SCALED_LADDER[0] == 8.0
    assert SCALED_LADDER[-1] == 2.0**-12
    assert len(SCALED_LADDER) == 16
    assert RAW_LADDER[0] == pytest.approx(1000.0)
    assert RAW_LADDER[-1] == 1.0


def test_central_differences_are_exact_on_a_parabola() -> None:
    """∂/∂a = 2(a − 30)/100 = 0.4, ∂/∂b = 2(b − 40)/100 = 0.6."""
    model = correct_by_bias(BOWL, fly(1, 50.0, 70))
    assert gradient(model, SPACE, np.array([50.0, 70.0]), SPACE.scale) == pytest.approx([0.4, 0.6], abs=1e-12)


def test_at_a_bound_the_difference_is_one_sided_and_stays_inside() -> None:
    """a = 100 with step 1: 7² − 6.9² = 1.39; b = 0 with step 2: ((38/10)² − 16)/2 = −0.78."""
    model = correct_by_bias(BOWL, fly(1, 100.0, 0))
    assert gradient(model, SPACE, np.array([100.0, 0.0]), SPACE.scale) == pytest.approx([1.39, -0.78], abs=1e-9)


def test_the_step_follows_the_unit_direction_in_scaled_gains() -> None:
    """From (50, 70) the scaled gradient is (4, 3), so a unit of length is −(0.8·10, 0.6·5) counts; 4 are best."""
    proposal = propose(evidence(Definition(), BOWL, [fly(1, 50.0, 70)]))
    assert proposal.kind == "step"
    assert proposal.explanation.chosen_length == 4.0
    assert proposal.gains == pytest.approx({"a": 18.0, "b": 58})
    assert proposal.explanation.gradient == pytest.approx({"a": 0.4, "b": 0.6})
    assert proposal.explanation.direction == pytest.approx({"a": -8.0, "b": -3.0})
    assert [step.length for step in proposal.explanation.ladder] == list(SCALED_LADDER)


def test_the_raw_option_measures_the_direction_in_counts() -> None:
    """The raw gradient is (0.4, 0.6)."""
    proposal = propose(evidence(Definition(options={"scaled": False}), BOWL, [fly(1, 50.0, 70)]))
    length = proposal.explanation.chosen_length
    assert length is not None
    assert length in RAW_LADDER
    assert proposal.gains["a"] == pytest.approx(50.0 - length * 0.4 / np.hypot(0.4, 0.6))


def test_the_bias_of_the_flight_stands_in_the_prediction() -> None:
    """The flights are 0.25 deeper than the model, so the prediction for (a, b) is the model's plus 0.25."""
    proposal = propose(evidence(Definition(), BOWL, [fly(1, 50.0, 70)]))
    expected = fly(2, proposal.gains["a"], proposal.gains["b"]).error
    assert proposal.predicted_error == pytest.approx(expected, abs=1e-6)
    assert proposal.predicted is not None
    assert proposal.predicted["depth"] == pytest.approx(np.full(11, expected), abs=1e-6)


def test_after_a_flight_that_did_not_improve_the_next_goes_half_as_far_along_the_same_line() -> None:
    flights = [fly(1, 50.0, 70)]
    first = propose(evidence(Definition(), BOWL, flights))
    for number, share in ((2, 0.5), (3, 0.25), (4, 0.125)):
        last = propose(evidence(Definition(), BOWL, flights))
        flights.append(fly(number, last.gains["a"], last.gains["b"], offset=90.0))
        shorter = propose(evidence(Definition(), BOWL, flights))
        assert shorter.kind == "shorter step"
        assert shorter.explanation.base_flight == 1
        assert shorter.explanation.direction == first.explanation.direction
        assert shorter.explanation.chosen_length == 4.0 * share
        assert shorter.gains["a"] == pytest.approx(50.0 - share * 32.0)
        assert "did not improve" in shorter.explanation.summary


def test_an_aborted_step_is_halved_too_but_never_becomes_the_base() -> None:
    first = propose(evidence(Definition(), BOWL, [fly(1, 50.0, 70)]))
    aborted = replace(fly(2, first.gains["a"], first.gains["b"]), outcome="aborted", error=None)
    shorter = propose(evidence(Definition(), BOWL, [fly(1, 50.0, 70), aborted]))
    assert (shorter.kind, shorter.explanation.base_flight) == ("shorter step", 1)


def test_an_improvement_becomes_the_base_of_a_new_line() -> None:
    first = propose(evidence(Definition(), BOWL, [fly(1, 50.0, 70)]))
    flights = [fly(1, 50.0, 70), fly(2, first.gains["a"], first.gains["b"])]
    second = propose(evidence(Definition(), BOWL, flights))
    assert (second.kind, second.explanation.base_flight) == ("step", 2)


DIMINISHING = Definition(options={"step_size": "diminishing"})


def test_a_diminishing_step_is_at_most_the_harmonic_share_of_the_last_successful_one() -> None:
    """A step of 12 in both gains is √(1.2² + 2.4²) scales long, and allows half of that; then one of 1 allows 2/3."""
    flights = [fly(1, 90.0, 90), fly(2, 78.0, 78)]
    length = np.hypot(1.2, 2.4)
    assert longest_step(SPACE, SPACE.scale, flights[:1]) is None
    assert longest_step(SPACE, SPACE.scale, flights) == pytest.approx(length / 2)
    assert longest_step(SPACE, SPACE.scale, [*flights, fly(3, 68.0, 78)]) == pytest.approx(2 / 3)
    assert longest_step(SPACE, SPACE.scale, [*flights, fly(3, 68.0, 78, offset=90.0)]) == pytest.approx(length / 2)
    proposal = propose(evidence(DIMINISHING, BOWL, flights))
    ladder = [step.length for step in proposal.explanation.ladder]
    assert ladder == pytest.approx([length / 2, *(step for step in SCALED_LADDER if step < length / 2)])
    assert proposal.explanation.chosen_length == pytest.approx(length / 2), "the optimum is further away"
    assert "at most 1.342 gain scales" in " ".join(proposal.explanation.notes)


def test_diminishing_steps_that_all_succeed_are_the_first_over_their_number() -> None:
    """α_k = α₁/k, up to rounding of `b`: Σα = ∞ and Σα² < ∞, the conditions of the paper's footnote 3."""
    flights = [fly(1, 90.0, 40), fly(2, 80.0, 40)]
    for number in range(3, 8):
        proposal = propose(evidence(DIMINISHING, BOWL, flights))
        flights.append(fly(number, proposal.gains["a"], proposal.gains["b"]))
    steps = -np.diff([flight.gains["a"] for flight in flights]) / 10.0
    assert steps == pytest.approx(1.0 / np.arange(1, 7))


def test_without_the_option_a_step_is_as_long_as_the_search_finds_best() -> None:
    flights = [fly(1, 90.0, 90), fly(2, 78.0, 78)]
    found = propose(evidence(Definition(), BOWL, flights))
    named = propose(evidence(Definition(options={"step_size": "line-search"}), BOWL, flights))
    assert (found.gains, found.explanation) == (named.gains, named.explanation)
    assert [step.length for step in found.explanation.ladder] == list(SCALED_LADDER)
    assert found.explanation.chosen_length == 4.0, "longer than the last step of 2.7"


def test_at_the_optimum_nothing_better_is_offered() -> None:
    proposal = propose(evidence(Definition(), BOWL, [fly(1, 30.0, 40)]))
    assert proposal.kind == "none"
    assert proposal.gains == {"a": 30.0, "b": 40}
    assert proposal.explanation.chosen_length is None
    assert "no better gains" in proposal.explanation.summary


def test_a_line_that_shrinks_to_its_base_offers_nothing_more() -> None:
    """With `a` held at its optimum only whole counts of `b` remain, and all of them were flown in vain."""
    space = SPACE.narrowed({"a": (30.0, 30.0 + 1e-12)})
    flights = [fly(1, 30.0, 46), *(fly(46 - b + 1, 30.0, b, offset=90.0) for b in range(45, 39, -1))]
    proposal = propose(evidence(Definition(), BOWL, flights, space))
    assert (proposal.kind, proposal.gains) == ("none", {"a": 30.0, "b": 46})


def test_no_line_is_halved_for_ever() -> None:
    """A real-valued gain never rounds to its base; 24 halvings below every scale end the search."""
    space = SPACE.narrowed({"b": (40, 41)})
    flights = [fly(1, 50.0, 40)]
    for number in range(2, 30):
        proposal = propose(evidence(Definition(), BOWL, flights, space))
        if proposal.kind == "none":
            break
        flights.append(fly(number, proposal.gains["a"], proposal.gains["b"], offset=90.0))
    assert len(flights) == 25


def test_the_step_limit_holds_each_gain_and_is_named() -> None:
    """A tenth of each range from (50, 70): a ≥ 40, b ≥ 60."""
    proposal = propose(evidence(Definition(step_fraction=0.1), BOWL, [fly(1, 50.0, 70)]))
    assert proposal.gains == pytest.approx({"a": 40.0, "b": 60})
    assert proposal.explanation.clipped == ("a", "b")


def test_a_pinned_gain_stays_and_the_others_descend() -> None:
    """With b pinned at 70 only ∂/∂a = 0.4 is left: the unit direction is −10 counts of a, and 2 units reach a = 30."""
    pinned = SPACE.narrowed({"b": (70, 70)})
    proposal = propose(evidence(Definition(bounds={"b": (70, 70)}), BOWL, [fly(1, 50.0, 70)], pinned))
    assert proposal.explanation.gradient == pytest.approx({"a": 0.4, "b": 0.0})
    assert proposal.gains == pytest.approx({"a": 30.0, "b": 70})


def test_with_every_gain_pinned_there_is_nothing_better() -> None:
    bounds = {"a": (50.0, 50.0), "b": (70.0, 70.0)}
    proposal = propose(evidence(Definition(bounds=bounds), BOWL, [fly(1, 50.0, 70)], SPACE.narrowed(bounds)))
    assert (proposal.kind, proposal.gains) == ("none", {"a": 50.0, "b": 70})


def test_a_step_that_the_gate_refuses_is_halved_until_it_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    """4 units from (50, 70) lead to a = 18; the experiment sees a hazard below a = 30, so 2 units it is."""

    def hazards(
        _bowl: QuadraticExperiment, gains: Vector, _spread: ParameterDistribution, _envelope: Envelope
    ) -> tuple[Check, ...]:
        return (Check("altitude", bool(gains[0] >= 30.0), "too high", worst=30.0, limit=30.0),)

    monkeypatch.setattr(QuadraticExperiment, "hazards", hazards)
    proposal = propose(evidence(Definition(), BOWL, [fly(1, 50.0, 70)]))
    assert proposal.kind == "shorter step"
    assert proposal.gains == pytest.approx({"a": 34.0, "b": 64})
    assert proposal.explanation.notes[-1] == "The gate refuses a 18, b 58."
    assert "is refused by the gate, so the next one is shorter" in proposal.explanation.summary


@pytest.mark.parametrize(("safe_gains", "a"), [({"a": 50.0, "b": 70}, 34.0), (None, 18.0)])
def test_the_vehicles_own_safe_gains_are_what_a_step_is_judged_with(
    monkeypatch: pytest.MonkeyPatch, safe_gains: dict[str, float] | None, a: float
) -> None:
    """An abort to these safe gains (not to the experiment's, a = 90) is a hazard from below a = 30."""

    def hazards(
        _bowl: QuadraticExperiment, gains: Vector, _spread: ParameterDistribution, envelope: Envelope
    ) -> tuple[Check, ...]:
        passed = bool(gains[0] >= 30.0 or envelope.safe_gains["a"] > 80.0)
        return (Check("abort altitude", passed, "too high", worst=30.0, limit=30.0),)

    monkeypatch.setattr(QuadraticExperiment, "hazards", hazards)
    definition = Definition(safe_gains=safe_gains)
    proposal = propose(evidence(definition, BOWL, [fly(1, 50.0, 70)]))
    assert proposal.gains["a"] == pytest.approx(a)
    gate = check_policy(evidence(definition, BOWL, [fly(1, 50.0, 70)]), proposal.gains, spread=proposal.spread)
    assert gate.passed
