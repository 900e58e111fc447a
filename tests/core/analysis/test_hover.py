"""The parameter for the hover throttle beside the throttle at which the vehicle hovers."""

import pytest

from app.autopilots.ardupilot.experiments import ardupilot_loop
from app.autopilots.px4.experiments import px4_loop
from app.core.analysis.hover import advise_hover, found_hover
from app.core.analysis.loop import AltitudeLoop
from app.core.errors import InputError


def px4(hover: float, deviation: float = 0.2) -> AltitudeLoop:
    return px4_loop({"MPC_THR_HOVER": hover, "HTE_THR_RANGE": deviation})


def ardupilot(hover: float) -> AltitudeLoop:
    return ardupilot_loop({"MOT_THST_HOVER": hover})


@pytest.mark.parametrize(
    ("loop", "throttle", "proposed", "said"),
    [
        (
            px4(0.5),
            0.742,
            0.742,
            "outside MPC_THR_HOVER ± HTE_THR_RANGE (0.300 … 0.700): the estimate in flight stops at 0.700",
        ),
        (px4(0.5, 0.01), 0.52, 0.52, "outside MPC_THR_HOVER ± HTE_THR_RANGE (0.490 … 0.510)"),
        (px4(0.7), 0.89, 0.8, "near the end of MPC_THR_HOVER ± HTE_THR_RANGE (0.500 … 0.900)"),
        (px4(0.5), 0.34, 0.34, "near the end of"),
        (px4(0.5), 0.56, 0.56, "MPC_THR_HOVER is 0.500: PX4 takes off with the parameter, whatever it"),
        (ardupilot(0.35), 0.53, 0.53, "MOT_THST_HOVER is 0.350: the integral has to make up for the difference"),
        (ardupilot(0.0), 0.53, 0.53, "MOT_THST_HOVER is 0.000: the integral has to make up for the difference"),
    ],
)
def test_a_wrong_hover_throttle_is_told_with_a_better_value(
    loop: AltitudeLoop, throttle: float, proposed: float, said: str
) -> None:
    advice = advise_hover(loop, throttle)
    assert advice is not None
    assert (advice.present, advice.proposed) == (loop.assumed_hover_throttle, proposed)
    assert advice.reason.startswith(f"The vehicle hovers at a throttle of {throttle:.3f}, ")
    assert said in advice.reason
    assert advice.reason.endswith(f"Set {advice.parameter} to {proposed:g}.")
    assert advice.is_outside == said.startswith("outside")
    then = loop.with_hover(advice.proposed)
    assert then.assumed_hover_throttle == proposed


@pytest.mark.parametrize(
    ("loop", "throttle"), [(px4(0.5), 0.54), (px4(0.8), 0.95), (ardupilot(0.39), 0.365), (ardupilot(0.125), 0.1)]
)
def test_a_hover_throttle_that_suits_or_cannot_be_set_gives_no_advice(loop: AltitudeLoop, throttle: float) -> None:
    assert advise_hover(loop, throttle) is None


def test_the_loop_finds_the_hover_throttle_within_its_limits() -> None:
    assert [found_hover(px4(0.5), each) for each in (0.1, 0.4, 0.9)] == pytest.approx([0.3, 0.4, 0.7])
    assert found_hover(ardupilot(0.35), 0.5) == 0.35
    with pytest.raises(InputError, match="HTE_THR_RANGE: must be 0 to 1"):
        px4(0.5, -0.1)
