"""The paper's Fig. 12: scatter of repeated takeoffs, and whether a battery shows in it."""

import numpy as np
import pytest

from app.reproductions.results import OVERRULE
from app.reproductions.variability import (
    POLICIES,
    REPEATS,
    pooled_sigma,
    repeated_errors,
    run_variability,
    share_with_trend,
)

DEFAULT, TUNED = (policy.gains for policy in POLICIES)


def test_the_pooled_scatter_is_that_within_batteries() -> None:
    """Two batteries of known scatter, far apart: √((2 + 8) / (2 + 2))."""
    assert pooled_sigma(np.array([[1.0, 2.0, 3.0], [10.0, 12.0, 14.0]])) == pytest.approx(np.sqrt(2.5))


def test_a_trend_is_seen_where_there_is_one() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.01, (400, REPEATS))
    assert share_with_trend(noise) == pytest.approx(0.1, abs=0.04), "by chance alone, at 90 %"
    assert share_with_trend(noise + 0.01 * np.arange(REPEATS)) > 0.98


def test_batteries_differ_and_the_same_battery_is_the_same() -> None:
    first = repeated_errors(DEFAULT, seed=1, group=0)
    assert first.shape == (REPEATS,)
    assert np.array_equal(first, repeated_errors(DEFAULT, seed=1, group=0))
    assert not np.array_equal(first, repeated_errors(DEFAULT, seed=1, group=1))
    assert first.mean() == pytest.approx(0.524, abs=0.02), "the twin's own error at these gains"


def test_a_fading_battery_makes_the_default_gains_score_better() -> None:
    """Less thrust, less overshoot: 3 % less moves the first row of Table 2 by far more than its scatter."""
    steady, fading = (repeated_errors(DEFAULT, seed=1, group=0, fade=fade) for fade in (0.0, 0.03))
    assert fading[0] == steady[0]
    assert fading[-1] < steady[-1] - 0.1


@pytest.mark.complete
def test_a_few_batteries_give_every_row_and_the_figure() -> None:
    told: list[float] = []
    result = run_variability(lambda share, _doing: told.append(share), groups=3, fading_groups=1)
    assert [row.label for row in result.rows[:3]] == ["σ of repeated flights", "mean error", "trend over a battery"]
    assert len(result.rows) == 10
    flown = [row.overruled for row in result.rows if row.gains]
    assert flown == ["", "", OVERRULE, OVERRULE], "the gate refuses the tuned gains only"
    assert told == sorted(told)
    assert told[-1] == 1.0
    panels = result.figures["figure12"].panels
    assert [len(panel.lines[-1].x) for panel in panels] == [REPEATS, REPEATS]
    shown = repeated_errors(TUNED, seed=1, group=0)
    assert panels[1].lines[-1].y == pytest.approx(shown.tolist(), abs=1e-6)


@pytest.mark.complete
def test_60_batteries_scatter_within_40_percent_of_the_papers() -> None:
    """Fig. 12: 0.0141 m at the default gains, 0.0066 m at the tuned ones."""
    result = run_variability(lambda _share, _doing: None, groups=60, fading_groups=1)
    default, tuned = (row for row in result.rows if row.label == "σ of repeated flights")
    assert default.measured == pytest.approx(0.0141, rel=0.4)
    assert tuned.measured == pytest.approx(0.0066, rel=0.4)
