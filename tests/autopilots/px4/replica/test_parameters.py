import math

import pytest

from app.autopilots.px4.replica.parameters import Parameters, low_pass_gain, parameters_from
from app.autopilots.px4.replica.vertical import DERIVATIVE_GAIN, VELOCITY_GAIN, packed
from app.core.errors import InputError


def test_values_by_the_firmwares_names() -> None:
    parameters = parameters_from({"MPC_Z_P": 1.5, "MPC_Z_VEL_P_ACC": 8.0, "MPC_TKO_RAMP_T": 1.0, "SIH_MASS": 2.0})
    assert parameters == Parameters(position_p_1_s=1.5, velocity_p_1_s=8.0, ramp_s=1.0)
    assert parameters.gains == {
        "MPC_Z_P": 1.5, "MPC_Z_VEL_P_ACC": 8.0, "MPC_Z_VEL_I_ACC": 2.0, "MPC_Z_VEL_D_ACC": 0.0,
    }  # fmt: skip


def test_gain_of_a_low_pass() -> None:
    """T/(T + 1/(2πf)): 0.008/(0.008 + 0.0318310)."""
    assert low_pass_gain(0.0, 0.008) == 1.0
    assert low_pass_gain(5.0, 0.008) == pytest.approx(0.008 / 0.039830989, rel=1e-6)
    constants = packed(Parameters())
    assert constants[VELOCITY_GAIN] == 1.0
    assert constants[DERIVATIVE_GAIN] == pytest.approx(0.008 / 0.039830989, rel=1e-6)


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"MPC_Z_VEL_P_ACC": 0.0}, "MPC_Z_VEL_P_ACC: must be positive"),
        ({"MPC_Z_P": -1.0}, "MPC_Z_P: must be at least 0"),
        ({"MPC_Z_P": math.inf}, "MPC_Z_P: must be at least 0"),
        ({"MPC_VEL_NF_FRQ": 20.0}, "MPC_VEL_NF_FRQ: must be 0"),
    ],
)
def test_values_for_which_the_loop_is_not_defined_are_named(values: dict[str, float], problem: str) -> None:
    with pytest.raises(InputError) as refusal:
        parameters_from(values)
    assert problem in str(refusal.value)
