"""Results are plain data: through JSON and back nothing is lost."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from app.figures.panels import Panel, Plot
from app.reproductions.results import OVERRULE, STORED, Result, Row, curve, marks

LINE = curve("Model", "model", np.arange(3.0), np.array([1, 2, 4]), note="a note")
RESULT = Result(
    rows=(
        Row(group="g", label="283, 13, 82", unit="m", measured=0.33, paper=0.3775, ratio=0.87, gains={"kp": 283.0}),
        Row(group="g", label="more", unit="", measured=1.0, numbers={"overshoot_m": 0.5}, overruled=OVERRULE),
    ),
    figures={"one": Plot(title="t", summary="s", x_title="x", panels=(Panel(y_title="y", lines=(LINE,)),))},
    notes=("A note.",),
)


def test_a_result_comes_back_from_json_as_it_was() -> None:
    assert STORED.validate_python(json.loads(json.dumps(asdict(RESULT)))) == RESULT


@pytest.mark.parametrize("document", [{}, {"rows": 1}, None, {"rows": [{}], "figures": {}}])
def test_anything_else_is_refused(document: object) -> None:
    with pytest.raises(ValueError, match="validation error"):
        STORED.validate_python(document)


def test_a_long_curve_is_thinned_and_keeps_its_peak() -> None:
    time_s = np.linspace(0.0, 30.0, 15_000)
    thin = curve("Run", "run 1", time_s, np.where(np.abs(time_s - 7.0) < 0.002, 9.0, 0.0))
    assert len(thin.x) <= 400
    assert max(thin.y) == 9.0


def test_marks_keep_every_point() -> None:
    drawn = marks("Flights", "run 1", np.arange(10.0), np.arange(10.0))
    assert drawn.marks
    assert drawn.x == tuple(map(float, range(10)))
