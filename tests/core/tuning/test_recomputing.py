"""The rule above all, over whole campaigns: whatever the strategy, the start and the stop rule, a proposal is the same
bit for bit when it is computed again from the history."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.definition import Definition, Donor, Flight, Start, StopRule
from app.core.tuning.proposals import advise
from app.core.tuning.stop_rules import evaluate_stop_rule
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategy import Proposal
from bench.predictions import prediction_of
from tests.core.tuning.defined import evidence, next_proposal, problems_of
from tests.core.tuning.flying import TAKEOFF, TWIN, compiled_only, fly

pytestmark = compiled_only

TUNED: dict[str, float] = {"kp": 1600, "ki": 900, "kd": 150}
WARM = Start(kind="campaign", gains=TUNED, donor=Donor(campaign_id=1, trial_number=4, checksum="0"))

DEFINITIONS = st.builds(
    Definition,
    strategy=st.sampled_from(sorted(name for name, strategy in STRATEGIES.items() if strategy.works_with(TAKEOFF))),
    start=st.sampled_from([Start(), WARM]),
    step_fraction=st.sampled_from([0.05, 1.0]),
    stop=st.builds(StopRule, kind=st.sampled_from(["paper", "noise", "budget"]), max_flights=st.just(4)),
)
FLYING = st.lists(
    st.tuples(st.sampled_from([TWIN, (0.66, 0.1, *TWIN[2:])]), st.floats(-0.02, 0.02), st.integers(0, 9)),
    min_size=4,
    max_size=4,
)


def content(proposal: Proposal) -> tuple[object, ...]:
    """Everything that there is of a proposal, its curves as bytes."""
    assert proposal.predicted is not None
    curves = {name: values.tobytes() for name, values in proposal.predicted.channels.items()}
    return replace(proposal, predicted=None), proposal.predicted.time_s.tobytes(), curves


def landed(number: int, proposal: Proposal, flown: tuple[tuple[float, ...], float, int]) -> Flight:
    """The proposal flown on some vehicle, scattered a little; one in ten is aborted."""
    model, scatter, chance = flown
    flight = fly(number, proposal.gains, model)
    assert flight.error is not None
    told = replace(flight, error=flight.error + scatter, predicted=prediction_of(proposal))
    return replace(told, error=None, outcome="aborted") if chance == 0 else told


Flying = list[tuple[tuple[float, ...], float, int]]


@pytest.mark.complete
@settings(max_examples=8)
@given(DEFINITIONS, FLYING)
def test_every_proposal_and_every_advice_is_recomputed_bit_for_bit(definition: Definition, flying: Flying) -> None:
    assert not problems_of(definition)
    donor = fly(4, TUNED, TWIN) if definition.start == WARM else None
    flights: list[Flight] = []
    for number, flown in enumerate(flying, start=1):
        proposal = next_proposal(definition, flights, donor)
        verdict = evaluate_stop_rule(evidence(definition, TAKEOFF, flights), proposal)
        advice = advise(evidence(definition, TAKEOFF, flights), proposal, verdict)
        again = next_proposal(copy.deepcopy(definition), copy.deepcopy(flights), copy.deepcopy(donor))
        assert content(again) == content(proposal)
        assert evaluate_stop_rule(evidence(definition, TAKEOFF, flights), again) == verdict
        assert advise(evidence(definition, TAKEOFF, copy.deepcopy(flights)), again, verdict) == advice
        assert proposal.predicted_error is not None
        if proposal.interval is None:
            flown_again = [flight.error for flight in flights if flight.gains == proposal.gains]
            assert len(set(flown_again) - {None}) == 1, "only repeats with the same error show no scatter"
        else:
            assert proposal.predicted_error in proposal.interval
        assert np.isfinite([*proposal.gains.values()]).all()
        flights.append(landed(number, proposal, flown))
