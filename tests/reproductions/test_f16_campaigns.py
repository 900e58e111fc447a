"""The F-16 experiment's study on a few inaccurate models, and the re-identified model over fifty."""

from itertools import pairwise

import pytest

from app.reproductions.f16_campaigns import BEST_ERROR, flights_to_optimum, showcase, study
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only


@pytest.mark.complete
def test_identified_again_the_optimum_is_flown_second() -> None:
    heard: list[str] = []
    (result,) = study(0.45, (10,), ("identified",), lambda: heard.append("a campaign"))
    assert heard == ["a campaign"]
    assert result.share == result.share_by(2) == 1.0
    assert result.median_flights == 2
    assert result.campaigns[0][-1] == pytest.approx(BEST_ERROR, abs=2e-4)


def test_without_a_model_the_simplex_takes_dozens_of_flights() -> None:
    (result,) = study(0.45, (10,), ("simplex",), lambda: None)
    assert result.share == 1.0
    assert 5 < result.flights[0] < 120


@pytest.mark.complete
def test_the_showcase_looks_like_the_papers_campaign() -> None:
    """The paper: near-optimal after 16 of 27 flights, the largest gain in the first step. Chosen: seed 50, 18 of 25."""
    shown = showcase()
    errors = shown.errors
    assert len(errors) == 25
    assert flights_to_optimum(errors) == 18
    gains = [before - after for before, after in pairwise(errors)]
    assert max(gains) == gains[0]
    assert shown.best.number == 25
    assert len(shown.search_errors) == pytest.approx(300, abs=1)
    assert shown.search_errors[0] > 5.0 * shown.search_errors[-1]
    assert shown.model_hand["pitch_rad"].shape == shown.model_start["pitch_rad"].shape


@pytest.mark.complete
@pytest.mark.timeout(900)
@pytest.mark.parametrize("perturbation", [0.2, 0.8])
def test_identified_again_every_model_is_near_by_the_second_flight(perturbation: float) -> None:
    """Eight models; `f16 --full` flies fifty, of which 49 are near. At 45 % the reproduction's brief form does so."""
    (result,) = study(perturbation, range(8), ("identified",), lambda: None, max_flights=2)
    assert result.share_by(2) == 1.0
