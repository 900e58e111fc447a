import math

import pytest

from app.autopilots.px4.replica.parameters import (
    Parameters,
    estimator_step_s,
    in_accelerations,
    in_thrusts,
    low_pass_gain,
    parameters_from,
)
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


def test_gains_of_a_share_of_thrust_are_those_of_an_acceleration_times_hover_thrust_over_gravity() -> None:
    """0.2 at a hover thrust of 0.49033 are 4, the firmware's own factor of 20."""
    older = {"MPC_Z_P": 1.0, "MPC_Z_VEL_P": 0.2, "MPC_Z_VEL_I": 0.02, "MPC_Z_VEL_D": 0.0}
    later = in_accelerations(older, 0.4903325)
    assert {name: later[name] for name in later if name.endswith("_ACC")} == pytest.approx(
        {"MPC_Z_VEL_P_ACC": 4.0, "MPC_Z_VEL_I_ACC": 0.4, "MPC_Z_VEL_D_ACC": 0.0}
    )
    assert in_thrusts({name: later[name] for name in later if name not in older} | {"MPC_Z_P": 1.0}, 0.4903325) == older


def test_the_loop_of_the_older_gains_ran_50_times_a_second() -> None:
    assert estimator_step_s({"MPC_Z_VEL_P": 0.2}) == 0.02
    assert estimator_step_s({"MPC_Z_VEL_P_ACC": 4.0}) == 0.01
