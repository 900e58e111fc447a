import math

import pytest

from app.autopilots.ardupilot.replica.parameters import (
    Parameters,
    in_names_of,
    in_newer_names,
    in_older_names,
    low_pass_gain,
    names_of,
    parameters_from,
)
from app.autopilots.ardupilot.replica.vertical import ACCELERATION_IMAX, HOVER, RAMP_END, THROTTLE_GAIN, packed
from app.core.errors import InputError


def test_values_by_the_firmwares_names_and_units() -> None:
    parameters = parameters_from({"PSC_POSZ_P": 2.2, "WPNAV_SPEED_UP": 250.0, "WPNAV_ACCEL_Z": 100.0, "RTL_ALT": 15.0})
    assert parameters == Parameters(position_p_1_s=2.2, climb_m_s=2.5, acceleration_m_s2=1.0)
    assert parameters.gains == {
        "PSC_POSZ_P": 2.2, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.0, "PSC_ACCZ_D": 0.0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("newer", "older"),
    [
        (("PSC_D_POS_P", 1.5), ("PSC_POSZ_P", 1.5)),
        (("PSC_D_VEL_P", 5.0), ("PSC_VELZ_P", 5.0)),
        (("PSC_D_VEL_IMAX", 10.0), ("PSC_VELZ_IMAX", 1000.0)),
        (("PSC_D_ACC_P", 0.05000000074505806), ("PSC_ACCZ_P", 0.5)),
        (("PSC_D_ACC_IMAX", 0.8), ("PSC_ACCZ_IMAX", 800.0)),
        (("PSC_D_ACC_FLTE", 20.0), ("PSC_ACCZ_FLTE", 20.0)),
        (("PSC_D_JERK", 5.0), ("PSC_JERK_Z", 5.0)),
        (("WP_SPD_UP", 2.5), ("WPNAV_SPEED_UP", 250.0)),
        (("WP_ACC_Z", 1.0), ("WPNAV_ACCEL_Z", 100.0)),
        (("MOT_THST_HOVER", 0.35), ("MOT_THST_HOVER", 0.35)),
    ],
)
def test_release_4_7_renamed_parameters_and_changed_their_units(
    newer: tuple[str, float], older: tuple[str, float]
) -> None:
    assert in_older_names(*newer) == older


@pytest.mark.parametrize(
    ("earlier", "name"),
    [
        ("POS_Z_P", "PSC_POSZ_P"),
        ("VEL_Z_P", "PSC_VELZ_P"),
        ("ACCEL_Z_I", "PSC_ACCZ_I"),
        ("ACCEL_Z_FILT_HZ", "PSC_ACCZ_FLTE"),
        ("PSC_ACCZ_FILT", "PSC_ACCZ_FLTE"),
        ("THR_ACCEL_P", "THR_ACCEL_P"),
    ],
)
def test_names_before_4_0_are_read_and_those_of_another_controller_are_not(earlier: str, name: str) -> None:
    assert in_older_names(earlier, 0.4) == (name, 0.4)


def test_gains_are_written_by_the_names_that_the_vehicle_has() -> None:
    gains = {"PSC_POSZ_P": 3.0, "PSC_ACCZ_P": 0.854}
    assert in_newer_names(gains, names_of(["POS_Z_P", "ACCEL_Z_P", "FRAME"])) == {"POS_Z_P": 3.0, "ACCEL_Z_P": 0.854}
    assert in_newer_names(gains, names_of(["PSC_POSZ_P", "PSC_ACCZ_P", "PSC_ACCZ_FILT"])) == gains
    assert in_newer_names(gains, names_of(["PSC_D_POS_P"])) == in_newer_names(gains)


def test_parameters_of_another_release_get_the_names_and_units_of_the_vehicle() -> None:
    of_4_7 = {"PSC_D_ACC_P": 0.05, "PSC_JERK_D": 5.0, "SCHED_LOOP_RATE": 400.0}
    of_4_6 = {"PSC_ACCZ_P": 0.5, "PSC_JERK_Z": 5.0, "SCHED_LOOP_RATE": 400.0}
    assert in_names_of(of_4_6, of_4_7.keys()) == of_4_7
    assert in_names_of(of_4_7, of_4_6.keys()) == of_4_6
    assert in_names_of(of_4_7, of_4_7.keys()) == of_4_7
    assert in_names_of({"POS_Z_P": 1.0}, ()) == {"PSC_POSZ_P": 1.0}


def test_gains_are_written_by_the_names_and_in_the_units_of_release_4_7() -> None:
    gains = {"PSC_POSZ_P": 3.0, "PSC_VELZ_P": 8.0, "PSC_ACCZ_P": 0.854, "PSC_ACCZ_I": 3.0}
    assert in_newer_names(gains) == {
        "PSC_D_POS_P": 3.0, "PSC_D_VEL_P": 8.0, "PSC_D_ACC_P": 0.0854, "PSC_D_ACC_I": 0.3,
    }  # fmt: skip
    assert in_newer_names({"MOT_THST_HOVER": 0.4}) == {"MOT_THST_HOVER": 0.4}


@pytest.mark.parametrize(
    ("filters_hz", "acceleration", "jerk"),
    [
        ((0.0, 20.0), 1.0, 5.0),
        ((0.0, 2.0), 1.0, 4.0 * math.pi / 5.0),
        ((1.0, 2.0), 1.0, 2.0 * math.pi / 5.0),
        ((0.0, 0.0), 1.0, 5.0),
        ((0.1, 0.0), 20.0, 9.80665 * 0.2 * math.pi / 5.0),
    ],
)
def test_filters_limit_the_jerk_of_the_trajectory(
    filters_hz: tuple[float, float], acceleration: float, jerk: float
) -> None:
    parameters = Parameters(
        acceleration_target_filter_hz=filters_hz[0],
        acceleration_error_filter_hz=filters_hz[1],
        acceleration_m_s2=acceleration,
    )
    assert parameters.shaping_jerk_m_s3 == pytest.approx(jerk)


def test_gain_of_a_low_pass() -> None:
    assert low_pass_gain(0.0, 0.0025) == 1.0
    assert low_pass_gain(20.0, 0.0025) == pytest.approx(0.0025 / (0.0025 + 0.0079577472))
    assert packed(Parameters(), 0.005)[THROTTLE_GAIN] == pytest.approx(0.005 / (0.005 + 0.0795774715))


@pytest.mark.parametrize(("hover", "used"), [(0.05, 0.125), (0.39, 0.39), (0.9, 0.6875)])
def test_hover_throttle_is_limited_as_in_the_firmware(hover: float, used: float) -> None:
    assert packed(Parameters(hover_throttle=hover))[HOVER] == used


def test_the_integrator_may_always_remove_the_hover_throttle() -> None:
    limits = [packed(Parameters(acceleration_imax_per_mille=imax))[ACCELERATION_IMAX] for imax in (0.0, 800.0)]
    assert limits == pytest.approx([350.0, 800.0])


@pytest.mark.parametrize(("most", "end"), [(0.5, 0.5), (0.95, 0.9)])
def test_the_ramp_ends_at_ninety_percent_at_the_latest(most: float, end: float) -> None:
    assert packed(Parameters(takeoff_throttle=most))[RAMP_END] == end


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"PSC_POSZ_P": 0.0}, "PSC_POSZ_P: must be positive"),
        ({"PSC_ACCZ_I": -1.0}, "PSC_ACCZ_I: must be at least 0"),
        ({"PSC_ACCZ_FLTE": math.nan}, "PSC_ACCZ_FLTE: must be at least 0"),
        ({"PSC_JERK_Z": math.inf}, "PSC_JERK_Z: must be positive"),
        ({"PSC_ACCZ_SMAX": 50.0}, "PSC_ACCZ_SMAX: must be 0 (PSC_D_ACC_SMAX since release 4.7)"),
    ],
)
def test_parameters_that_the_loop_is_not_defined_for_are_refused(values: dict[str, float], problem: str) -> None:
    with pytest.raises(InputError) as refusal:
        parameters_from(values)
    assert problem in str(refusal.value)


def test_what_the_replica_lacks_may_be_switched_off() -> None:
    assert parameters_from({"PSC_ACCZ_SMAX": 0.0}) == Parameters()
