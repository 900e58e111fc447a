"""The computation of a proposal: what follows from a campaign's flights is computed once."""

from collections import Counter
from collections.abc import Sequence

import pytest

from app.campaigns.computation import CampaignHistory, compute
from app.core.definition import Definition, Donor, Flight, Start, StopRule
from app.core.experiments.base import Scatter
from app.core.statistics.comparisons import Group, PooledScatter, groups_of, pool_scatter
from tests.core.tuning.flying import compiled_only, fly

START: dict[str, float] = {"kp": 283, "ki": 13, "kd": 82}
BETTER: dict[str, float] = {"kp": 900, "ki": 120, "kd": 150}
WARM = Start(kind="campaign", gains=BETTER, donor=Donor(campaign_id=1, trial_number=5, checksum="0"))
WIDE: dict[str, tuple[float, float]] = {}
NARROW: dict[str, tuple[float, float]] = {"kp": (0, 600)}


@compiled_only
@pytest.mark.parametrize("strategy", ["calibrated", "gradient", "simplex", "manual"])
@pytest.mark.parametrize(
    ("start", "bounds", "flown", "sets"),
    [
        (Start(), WIDE, 0, 1),
        (Start(), WIDE, 1, 1),
        (Start(), WIDE, 3, 1),
        (WARM, WIDE, 3, 1),
        (Start(), NARROW, 3, 2),  # those within the bounds are compared by themselves
    ],
)
def test_a_proposal_with_its_gate_verdict_and_advice_groups_each_set_of_flights_once(
    monkeypatch: pytest.MonkeyPatch,
    strategy: str,
    start: Start,
    bounds: dict[str, tuple[float, float]],
    flown: int,
    sets: int,
) -> None:
    grouped, pooled = Counter[object](), Counter[object]()

    def group(flights: Sequence[Flight]) -> tuple[Group, ...]:
        grouped[tuple(flight.number for flight in flights)] += 1
        return groups_of(flights)

    def pool(groups: Sequence[Group], prior: Scatter) -> PooledScatter:
        pooled[tuple(group.numbers for group in groups)] += 1
        return pool_scatter(groups, prior)

    monkeypatch.setattr("app.core.tuning.evidence.groups_of", group)
    monkeypatch.setattr("app.core.tuning.evidence.pool_scatter", pool)
    flights = tuple(fly(number, gains) for number, gains in enumerate((START, BETTER, BETTER)[:flown], start=1))
    definition = Definition(strategy=strategy, start=start, bounds=bounds, stop=StopRule(max_flights=8))
    donor = fly(5, BETTER) if start == WARM else None
    compute(CampaignHistory(definition=definition, flights=flights, digest="", donor=donor))
    assert set(grouped.values()) == set(pooled.values()) == {1}
    assert 1 <= len(pooled) <= len(grouped) <= sets
