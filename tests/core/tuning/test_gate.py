import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.definition import Definition, Start
from app.core.errors import GainsError
from app.core.experiments.base import Check, ParameterDistribution, prior_distribution
from app.core.tuning.gate import GateResult, check_policy, check_step, problems_of_gate, require_flyable
from tests.core.tuning.defined import evidence
from tests.core.tuning.flying import TAKEOFF, compiled_only, fly

SPACE = TAKEOFF.space
DEFAULT: dict[str, float] = {"kp": 283, "ki": 13, "kd": 82}


def check(name: str, gains: dict[str, float], definition: Definition | None = None, flown: bool = False) -> Check:
    flights = [fly(1, DEFAULT)] if flown else []
    gate = check_policy(evidence(definition or Definition(), TAKEOFF, flights), gains)
    assert gate.passed == all(one.passed for one in gate.checks)
    return next(one for one in gate.checks if one.name == name)


@pytest.mark.parametrize(
    ("gains", "sentence", "worst"),
    [
        (DEFAULT | {"kp": -1}, "kp must be between 0 and 4000 counts, got -1.", 1 / 4000),
        (DEFAULT | {"ki": 1356}, "ki must be between 0 and 1073 counts, got 1356.", 283 / 1073),
    ],
)
@compiled_only
def test_gains_out_of_their_bounds_are_refused_by_name(gains: dict[str, float], sentence: str, worst: float) -> None:
    bounds = check("bounds", gains)
    assert (bounds.passed, bounds.sentence) == (False, sentence)
    assert bounds.worst == pytest.approx(worst)


@pytest.mark.parametrize(
    ("gains", "sentence", "worst"),
    [
        (DEFAULT | {"kd": 82.5}, "kd must be a whole number of counts, got 82.5.", 0.0),
        (DEFAULT | {"kd": math.nan}, "kd must be a finite number, got nan.", math.inf),
        (DEFAULT | {"kp": 2**31}, "kp must fit in 32 bits, got 2147483648.", (2**31 - 4000) / 4000),
    ],
)
def test_numbers_that_no_controller_holds_are_refused_alone_and_for_good(
    gains: dict[str, float], sentence: str, worst: float
) -> None:
    gate = check_policy(evidence(Definition(), TAKEOFF, []), gains)
    assert [(one.name, one.passed, one.sentence) for one in gate.checks] == [("numbers", False, sentence)]
    assert gate.checks[0].worst == pytest.approx(worst, nan_ok=True)
    with pytest.raises(GainsError, match="The gate refuses these gains"):
        require_flyable(gate, overrule="to see what happens")


@compiled_only
def test_before_the_first_flight_a_quarter_of_each_range_around_the_start_is_allowed() -> None:
    """kd may change by 0.25·409 = 102.25 counts."""
    assert check("step", DEFAULT | {"kd": 184}).passed
    refused = check("step", DEFAULT | {"kd": 185})
    assert not refused.passed
    assert refused.worst == pytest.approx(103 / 409)
    assert refused.limit == 0.25
    assert refused.sentence == (
        "kd changes most, by 25.2\u00a0% of its range; only 25\u00a0% is allowed from the start gains "
        "before the first valid flight."
    )


@compiled_only
def test_the_start_gains_themselves_change_nothing() -> None:
    assert check("step", DEFAULT).sentence == (
        "No gain changes; at most 25\u00a0% is allowed from the start gains before the first valid flight."
    )


@compiled_only
def test_after_a_valid_flight_the_whole_range_is_open_by_default() -> None:
    assert check("step", {"kp": 4000, "ki": 1073, "kd": 409}, flown=True).passed


@compiled_only
def test_later_steps_are_measured_from_the_nearest_flown_gains() -> None:
    definition = Definition(step_fraction=0.1)
    flights = [fly(1, DEFAULT), fly(2, {"kp": 1600, "ki": 900, "kd": 127})]
    near = check_policy(evidence(definition, TAKEOFF, flights), {"kp": 2000, "ki": 1000, "kd": 100})
    far = check_policy(evidence(definition, TAKEOFF, flights), {"kp": 2001, "ki": 1000, "kd": 100})
    assert [one.passed for gate in (near, far) for one in gate.checks if one.name == "step"] == [True, False]


@compiled_only
def test_the_models_optimum_is_allowed_as_the_start_it_was_chosen_to_be() -> None:
    definition = Definition(start=Start(kind="simplex"))
    assert not check("step", DEFAULT, definition).passed
    assert check("step", {"kp": 1742, "ki": 881, "kd": 119}, definition).passed


@given(
    st.fixed_dictionaries({gain.name: st.integers(int(gain.lower), int(gain.upper)) for gain in SPACE.gains}),
    st.floats(0.01, 1.0),
)
def test_what_is_reachable_passes_and_what_is_offered_is_reachable(gains: dict[str, float], fraction: float) -> None:
    step = check_step(SPACE, gains, [DEFAULT], fraction, "the start gains")
    low, high = SPACE.reachable(SPACE.default, fraction)
    assert step.passed == bool(((low <= SPACE.vector(gains)) & (SPACE.vector(gains) <= high)).all())
    assert check_step(SPACE, gains | dict(step.offer), [DEFAULT], fraction, "the start gains").passed


@compiled_only
def test_a_pinned_gain_is_refused_at_any_other_value_and_flown_at_its_own() -> None:
    definition = Definition(bounds={"ki": (13, 13)})
    own, other = (check_policy(evidence(definition, TAKEOFF, []), DEFAULT | {"ki": ki}) for ki in (13, 14))
    assert (own.passed, other.passed) == (True, False)
    refused = other.checks[0]
    assert (refused.name, refused.gain, refused.worst) == ("bounds", "ki", math.inf)


@compiled_only
def test_a_refused_step_names_its_gain() -> None:
    gate = check_policy(evidence(Definition(), TAKEOFF, []), DEFAULT | {"kd": 400})
    assert [(check.name, check.gain) for check in gate.checks if not check.passed] == [("step", "kd")]


@compiled_only
def test_a_refusal_is_overruled_on_a_simulated_vehicle_and_on_a_real_one_by_nobody() -> None:
    refused = check_policy(evidence(Definition(), TAKEOFF, []), DEFAULT | {"ki": 1356})
    passed = check_policy(evidence(Definition(), TAKEOFF, []), DEFAULT)
    assert require_flyable(refused, overrule="the paper flew it") == "the paper flew it"
    assert require_flyable(passed, overrule="to be sure") == require_flyable(passed) == ""
    with pytest.raises(GainsError, match="The gate cannot be overruled on a real vehicle"):
        require_flyable(refused, overrule="the paper flew it", is_real=True)


def test_random_models_are_of_the_distribution_that_the_gate_samples() -> None:
    """Half as much again as known lies outside of both: they end at two standard deviations, and at zero."""
    spread = prior_distribution(TAKEOFF)
    at_random = np.random.default_rng(1).random((200, len(spread.mean)))
    for models in (spread.sample(TAKEOFF, 200), spread.models(TAKEOFF, at_random)):
        for values, parameter in zip(models.T, TAKEOFF.model_parameters, strict=True):
            assert values.min() >= max(parameter.nominal - parameter.known_within - 1e-12, parameter.lower)
            assert values.max() <= parameter.nominal + parameter.known_within + 1e-12
        assert models[:, 0].std() == pytest.approx(0.022, abs=0.002)  # 0.05 / 2, cut off at two of them


@compiled_only
def test_what_is_offered_for_several_refusals_passes_all_of_these_checks() -> None:
    """Bounds and wrapping let ki = 1073 pass, the step limit only 13 + 0.25·1073 = 281."""
    asked: dict[str, float] = {"kp": 1624, "ki": 1356, "kd": 195}
    refused = check_policy(evidence(Definition(), TAKEOFF, []), asked)
    merged = {name: value for one in refused.refusals for name, value in one.offer.items()}
    assert merged == {"kp": 1283, "ki": 281, "kd": 184}
    assert all(one.offer.get("ki", 281) == 281 for one in refused.refusals)
    with pytest.raises(GainsError, match="kp = 1283, kd = 184") as raised:
        require_flyable(refused)
    assert "ki = 281" in raised.value.hint
    assert "stuck on the ground" in str(raised.value)
    assert "The largest ki that cannot overflow is 1073." in str(raised.value)
    assert ".." not in str(raised.value)
    limits = {"bounds", "step", "wrapping"}
    offered = check_policy(evidence(Definition(), TAKEOFF, []), asked | merged)
    assert all(one.passed for one in offered.checks if one.name in limits)


@compiled_only
def test_gains_that_have_flown_may_fly_again_although_simulated_takeoffs_go_astray() -> None:
    """A light vehicle; without damping some models rise too high. What can wrap stays refused."""
    light = (0.496, 0.25, 0.0975, 0.284, 0.66, 0.16, 0.035, 0.002)
    flown = [fly(1, DEFAULT, light)]
    far = ParameterDistribution(
        mean=light, covariance=tuple(tuple(row) for row in np.diag([4e-4] + [0.0] * 7).tolist()), origin="it"
    )
    kp_only: dict[str, float] = {"kp": 283, "ki": 13, "kd": 0}
    fresh = check_policy(evidence(Definition(), TAKEOFF, flown), kp_only, spread=far)
    again = check_policy(evidence(Definition(), TAKEOFF, [*flown, fly(2, kp_only, light)]), kp_only, spread=far)
    assert "altitude" in {one.name for one in fresh.refusals}
    assert "altitude" not in {one.name for one in again.refusals}
    told = [one for one in again.checks if one.name == "altitude"]
    assert told[0].sentence.endswith("completed with these gains, so they are allowed again.")
    papers: dict[str, float] = DEFAULT | {"ki": 1356}
    wrapping = check_policy(evidence(Definition(), TAKEOFF, [*flown, fly(2, papers)]), papers, spread=far)
    assert {"bounds", "wrapping"} <= {one.name for one in wrapping.refusals}


@compiled_only
def test_the_step_of_a_gain_outside_its_bounds_is_that_to_the_bound() -> None:
    """Its distance in percent of the range says nothing: the bound is what refuses it."""
    result = check_policy(evidence(Definition(step_fraction=1.0), TAKEOFF, [fly(1, DEFAULT)]), DEFAULT | {"kp": 99999})
    assert [check.name for check in result.refusals if check.name in {"bounds", "step"}] == ["bounds"]
    assert next(check.offer for check in result.refusals if check.name == "bounds") == {"kp": 4000}


@compiled_only
def test_the_sentence_says_that_the_step_is_that_to_the_bound() -> None:
    assert check("step", DEFAULT | {"kp": 99999}).sentence.startswith(
        "kp changes most, by 92.9\u00a0% of its range to its bound;"
    )


def test_what_cannot_be_flown_is_the_first_problem_then_harm_in_flight_then_the_others() -> None:
    names = ("step", "altitude", "wrapping", "hover throttle", "bounds")
    gate = GateResult(tuple(Check(name, False, name, worst=1.0, limit=0.0) for name in names))
    found = [problem.reason for problem in problems_of_gate(gate)]
    assert found == ["bounds", "wrapping", "altitude", "step", "hover throttle"]
