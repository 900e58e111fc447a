"""The atlas of failure shapes, and what is written about those found in a log."""

import pytest
from fastapi.testclient import TestClient

from app.core.analysis.shapes import FailureShape, FoundShape
from app.log_library.library_schemas import AtlasShape
from app.log_library.shapes import texts_of


def test_the_atlas_has_every_shape_with_a_figure_in_both_themes(client: TestClient) -> None:
    atlas = [AtlasShape.model_validate(each) for each in client.get("/api/failure-shapes").json()]
    assert [each.code for each in atlas] == list(FailureShape)
    for each in atlas:
        assert set(each.figures) == {"light", "dark"}
        assert {card.state for card in each.figures.values()} == {"ready"}
        assert each.figures["light"].summary


NUMBERS = {
    FailureShape.RINGING: {"frequency_hz": 0.7, "amplitude_m": 0.2},
    FailureShape.WINDUP: {"overshoot_m": 0.6, "lasts_s": 1.4},
    FailureShape.HOVER_THROTTLE: {"hover_throttle_1": 0.4, "assumed_1": 0.35},
    FailureShape.SATURATED_CLIMB: {"at_limit_s": 3.0, "behind_m": 0.5},
    FailureShape.ESTIMATOR_JUMP: {"altitude_m": -1.5, "climb_rate_m_s": 0.2, "jumps_1": 2.0},
    FailureShape.VIBRATION: {"noise_m_s2": 2.0},
    FailureShape.WIND: {"disturbance_m_s2": 1.0},
}


@pytest.mark.parametrize("shape", FailureShape)
def test_a_shape_is_told_with_the_numbers_of_the_log(shape: FailureShape) -> None:
    (found,) = texts_of([FoundShape(shape=shape, numbers=NUMBERS[shape], since_s=12.0)])
    for value in NUMBERS[shape].values():
        assert f"{abs(value):g}" in found.found
    assert found.title
    assert "{" not in found.found + found.recognised + found.advice
