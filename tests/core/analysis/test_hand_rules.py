"""Margins of gains on the usual copter with a known hover throttle."""

import pytest

from app.core.analysis.hand_rules import usual_margins
from tests.core.analysis.flights import QUIET, simulated_flight


def test_margins_on_the_usual_copter_fall_with_the_gains_and_rise_with_the_hover_throttle() -> None:
    """All feedback passes through the gains over hover throttle, so that the margin is about proportional to it."""
    loop = simulated_flight(QUIET).loop
    light, heavy = (usual_margins(loop, hover) for hover in (0.2, 0.4))
    assert light.sets[0].name == "As flown"
    assert heavy.sets[0].margin == pytest.approx(2.0 * light.sets[0].margin, rel=0.1)
    stiff = next(each for each in heavy.sets if each.gains["PSC_ACCZ_P"] == 1.0)
    assert stiff.margin < heavy.sets[0].margin
