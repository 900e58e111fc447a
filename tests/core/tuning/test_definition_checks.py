import math
from dataclasses import replace

import pytest

from app.autopilots.registry import EXPERIMENTS
from app.core.definition import Definition, Donor, Start, StopRule
from tests.core.tuning.defined import problems_of

GOOD = Definition()


def test_the_default_definition_has_no_problems() -> None:
    assert problems_of(GOOD) == ()
    narrowed = replace(GOOD, options={"scaled": False}, bounds={"kp": (100, 2000)}, start=Start(kind="simplex"))
    assert problems_of(narrowed) == ()
    assert problems_of(replace(GOOD, start=Start(kind="given", gains={"kp": 1, "ki": 2, "kd": 3}))) == ()


@pytest.mark.parametrize(
    ("definition", "field", "reason"),
    [
        (
            replace(
                GOOD,
                start=Start(
                    kind="given",
                    gains={"kp": 1, "ki": 2, "kd": 3},
                    donor=Donor(campaign_id=4, trial_number=1, checksum=""),
                ),
            ),
            "start.donor",
            "is required with start.kind 'campaign', and not allowed with any other",
        ),
        (replace(GOOD, ceiling_m=101.0), "ceiling_m", "must be between 3.2 and 100 m, got 101"),
        (replace(GOOD, stop=StopRule(confidence=1.0)), "stop.confidence", "must be at least 0.5 and below 1, got 1"),
        (replace(GOOD, stop=StopRule(min_battery_v=-1.0)), "stop.min_battery_v", "must be above 0 V, got -1"),
        (
            replace(GOOD, experiment="landing"),
            "experiment",
            f"must be one of {', '.join(EXPERIMENTS)}, got 'landing'",
        ),
        (
            replace(GOOD, strategy="luck"),
            "strategy",
            "must be one of calibrated, gradient, identified, simplex, manual, got 'luck'",
        ),
        (replace(GOOD, strategy="identified"), "strategy", "'identified' works only with pitch-tracking"),
        (
            replace(GOOD, options={"raw": True}),
            "options.raw",
            "is not an option of gradient (options: scaled, bias, step_size)",
        ),
        (
            replace(GOOD, strategy="manual", options={"raw": 1}),
            "options.raw",
            "is not an option of manual (options: none)",
        ),
        (replace(GOOD, options={"scaled": 1}), "options.scaled", "must be one of true, false, got 1"),
        (replace(GOOD, bounds={"kx": (0, 1)}), "bounds.kx", "is not a gain of this experiment (kp, ki, kd)"),
        (
            replace(GOOD, bounds={"kp": (9, 5)}),
            "bounds.kp",
            "must be two numbers, the lower first, inside 0 … 4000, got 9 … 5",
        ),
        (replace(GOOD, bounds={"kp": (0, math.nan)}), "bounds.kp", "must be whole numbers, got 0 … nan"),
        (replace(GOOD, bounds={"ki": (0.5, 99)}), "bounds.ki", "must be whole numbers, got 0.5 … 99"),
        (replace(GOOD, bounds={"kp": (500, 600)}), "bounds.kp", "must hold the start gain 283, got 500 … 600"),
        (replace(GOOD, start=Start(kind="given")), "start.gains", "are required with start.kind 'given'"),
        (replace(GOOD, start=Start(gains={"kp": 1})), "start.gains", "are not allowed with start.kind 'default'"),
        (
            replace(GOOD, start=Start(kind="given", gains={"kp": 1, "ki": 2.5, "kd": 3})),
            "start.gains.ki",
            "must be a whole number of counts, got 2.5",
        ),
        (replace(GOOD, first_step_fraction=0.0), "first_step_fraction", "must be above 0 and at most 1, got 0"),
        (replace(GOOD, step_fraction=1.5), "step_fraction", "must be above 0 and at most 1, got 1.5"),
        (replace(GOOD, step_fraction=math.nan), "step_fraction", "must be above 0 and at most 1, got nan"),
        (replace(GOOD, stop=StopRule(max_flights=0)), "stop.max_flights", "must be between 1 and 200, got 0"),
        (replace(GOOD, stop=StopRule(max_flights=201)), "stop.max_flights", "must be between 1 and 200, got 201"),
        (replace(GOOD, stop=StopRule(improvement=0.51)), "stop.improvement", "must be between 0 and 0.5, got 0.51"),
        (replace(GOOD, stop=StopRule(improvement=math.nan)), "stop.improvement", "must be between 0 and 0.5, got nan"),
        (replace(GOOD, seed=-1), "seed", "must be between 0 and 9007199254740991, got -1"),
    ],
)
def test_each_unusable_field_is_named_with_its_reason(definition: Definition, field: str, reason: str) -> None:
    assert [(problem.field, problem.reason) for problem in problems_of(definition)] == [(field, reason)]


def test_all_problems_are_reported_at_once() -> None:
    start = Start(kind="given", gains={"kp": -1, "ki": 13, "kd": 82})
    wrong = replace(GOOD, strategy="luck", seed=-1, step_fraction=0.0, bounds={"ki": (9.0, 3.0)}, start=start)
    fields = [problem.field for problem in problems_of(wrong)]
    assert fields == ["strategy", "bounds.ki", "start.gains.kp", "step_fraction", "seed"]
