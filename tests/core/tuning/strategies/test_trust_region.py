from dataclasses import replace
from typing import Literal

import pytest

from app.core.definition import Flight, Interval, Prediction
from app.core.tuning.strategies.calibrated import trust_fraction
from tests.core.tuning.bowl import fly

Came = Literal["held", "missed", "better", "aborted", "cautious", "untold"]


def flown(number: int, outcome: Came) -> Flight:
    """A flight that was told 0.9 … 1.1 times its error, or not."""
    flight = fly(number, 30.0, 40)
    assert flight.error is not None
    factor = {"held": 1.0, "missed": 0.5, "better": 2.0, "aborted": 1.0, "cautious": 1.0, "untold": 1.0}[outcome]
    told = Prediction(
        error=factor * flight.error,
        interval=Interval(lower=0.9 * factor * flight.error, upper=1.1 * factor * flight.error),
    )
    if outcome in {"aborted", "cautious"}:
        against = outcome == "aborted"
        return replace(flight, outcome="aborted", error=None, predicted=told, against_gains=against)
    return replace(flight, predicted=None if outcome == "untold" else told)


@pytest.mark.parametrize(
    ("history", "fraction"),
    [
        ([], 1.0),
        (["missed"], 1.0),
        (["held", "held"], 1.0),
        (["untold", "missed"], 0.5),
        (["untold", "missed", "missed"], 0.25),
        (["untold", "missed", "missed", "held"], 0.5),
        (["untold", "missed", "held", "held"], 1.0),
        (["untold", "missed", "better"], 0.5),
        (["untold", "missed", "untold"], 0.5),
        (["aborted", "untold"], 0.5),
        (["untold", "aborted", "aborted"], 0.25),
        (["untold", "cautious", "cautious", "cautious"], 1.0),
        (["untold", "cautious", "aborted"], 0.5),
    ],
)
def test_trust_shrinks_after_an_abort_and_a_miss_and_grows_again_with_predictions_that_held(
    history: list[Came], fraction: float
) -> None:
    assert trust_fraction([flown(number, each) for number, each in enumerate(history, start=1)]) == fraction
