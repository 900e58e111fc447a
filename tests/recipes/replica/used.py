"""A trace is recognised, and the analysis of a log says how well the replica explains it."""

import pytest

from app.log_library.content import analyze_content
from app.log_library.schemas import ReplicaAnswer

STEPS = [(0.1 * step, 3.0, 0.2 * step, min(0.5 + 0.2 * (3.0 - 0.2 * step), 1.0)) for step in range(20)]


def trace(*rows: tuple[float, ...]) -> bytes:
    lines = ("t_s,target_m,altitude_m,toy_throttle", *(",".join(f"{value:.9f}" for value in row) for row in rows))
    return "\n".join(lines).encode()


AGREES = "The replica agrees: all 20 steps are within the tolerances in throttle."
DIFFERS = "The replica differs: 1 of 20 steps is not within the tolerances, the first at 1.000 s in throttle."


@pytest.mark.parametrize(("at_10", "sentence"), [(STEPS[10], AGREES), ((*STEPS[10][:3], 0.9), DIFFERS)])
def test_the_trace_is_compared_step_by_step(at_10: tuple[float, ...], sentence: str) -> None:
    found = analyze_content(trace(*STEPS[:10], at_10, *STEPS[11:]), None, "run.csv")
    answer = found.answer
    assert answer.autopilot == "Toy"
    assert isinstance(answer.replica, ReplicaAnswer)
    assert answer.texts.replica.answer == sentence
    assert [plot.title for plot in found.plots["replica"]] == ["Throttle"]
