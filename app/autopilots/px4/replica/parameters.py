"""Parameters of PX4's vertical loop, with the firmware's names."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from app.autopilots.px4.replica.hover_range import HOVER_RANGE_NAME
from app.core.control.parameter_checks import ReplicaParameters, parameter, require_within
from app.core.errors import InputError
from app.core.models.copter import GRAVITY_M_S2
from app.core.reasons import Reason, ReasonCode

STEP_S: Final = 1 / 125
"""Interval of the estimates of position in PX4's own simulation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(ReplicaParameters):
    """What the loop depends on.

    Thrust is a share of full thrust. A filter of 0 Hz is none; a ramp of 0 s ends at once.
    """

    position_p_1_s: float = parameter("MPC_Z_P", 1.0, gain=True)
    velocity_p_1_s: float = parameter("MPC_Z_VEL_P_ACC", 4.0, positive=True, gain=True)
    velocity_i_1_s2: float = parameter("MPC_Z_VEL_I_ACC", 2.0, gain=True)
    velocity_d: float = parameter("MPC_Z_VEL_D_ACC", 0.0, gain=True)
    climb_m_s: float = parameter("MPC_Z_VEL_MAX_UP", 3.0)
    descent_m_s: float = parameter("MPC_Z_VEL_MAX_DN", 1.5)
    thrust_min: float = parameter("MPC_THR_MIN", 0.12)
    thrust_max: float = parameter("MPC_THR_MAX", 1.0)
    hover_thrust: float = parameter("MPC_THR_HOVER", 0.5, positive=True)
    ramp_s: float = parameter("MPC_TKO_RAMP_T", 3.0)
    spool_s: float = parameter("COM_SPOOLUP_TIME", 1.0)
    velocity_filter_hz: float = parameter("MPC_VEL_LP", 0.0)
    derivative_filter_hz: float = parameter("MPC_VELD_LP", 5.0)
    land_speed_m_s: float = parameter("MPC_LAND_SPEED", 0.7, positive=True)


DEFAULTS: Final[Mapping[str, float]] = MappingProxyType(Parameters().named)
"""The firmware's, by its names."""

UNSUPPORTED: Final = ("MPC_VEL_NF_FRQ",)
"""The notch filter of the measured velocity, which the replica lacks: it must be off, as it is by default."""


def low_pass_gain(cutoff_hz: float, sample_s: float) -> float:
    """Share of the input that a first-order low-pass adopts per sample, 0 … 1; 1 for a cut-off of 0.

    In single precision: the filtered velocity depends on its last bit.
    """
    if cutoff_hz == 0.0:
        return 1.0
    sample = np.float32(sample_s)
    return float(sample / (sample + np.float32(1.0) / (np.float32(2.0 * math.pi) * np.float32(cutoff_hz))))


THRUST_GAINS: Final[Mapping[str, str]] = MappingProxyType(
    {f"MPC_Z_VEL_{term}_ACC": f"MPC_Z_VEL_{term}" for term in ("P", "I", "D")}
)
"""Gains of an acceleration, each with that until release 1.10, of a share of full thrust."""
THRUST_DEFAULTS: Final[Mapping[str, float]] = MappingProxyType(
    {"MPC_Z_P": 1.0, "MPC_Z_VEL_P": 0.2, "MPC_Z_VEL_I": 0.02, "MPC_Z_VEL_D": 0.0}
)


def in_accelerations(values: Mapping[str, float], hover_thrust: float) -> dict[str, float]:
    """Parameters by the firmware's names, with the later gains of a vehicle that hovers with this thrust, > 0."""
    factor = GRAVITY_M_S2 / hover_thrust
    return {**{name: values[older] * factor for name, older in THRUST_GAINS.items() if older in values}, **values}


def in_thrusts(gains: Mapping[str, float], hover_thrust: float) -> dict[str, float]:
    """Gains as until release 1.10, of a vehicle that hovers with this thrust; seven digits, as the firmware has."""
    factors = dict.fromkeys(THRUST_GAINS, hover_thrust / GRAVITY_M_S2)
    scaled = {name: float(f"{value * factors.get(name, 1.0):.7g}") for name, value in gains.items()}
    return {THRUST_GAINS.get(name, name): value for name, value in scaled.items()}


_PREDICTION, _IMU_RATE = "EKF2_PREDICT_US", "IMU_INTEG_RATE"
_PREDICTION_US, _IMU_HZ = 10_000.0, 200.0
_LONGEST_STEP_S: Final = 0.02
_RANGES: Final = {_PREDICTION: (0.0, 1e6), _IMU_RATE: (0.0, 1000.0)}
"""With these no step is shorter than 1 ms."""
ESTIMATOR_NAMES: Final = (_PREDICTION, _IMU_RATE)
"""Parameters on which the interval of the estimates depends."""
LOOP_NAMES: Final = (*DEFAULTS, *UNSUPPORTED, *ESTIMATOR_NAMES, HOVER_RANGE_NAME)
"""All that the loop depends on."""


def estimator_step_s(values: Mapping[str, float]) -> float:
    """Interval of the estimates that the loop takes, s, from the firmware's values by name: whole intervals of the IMU;
    with the gains until release 1.10 the loop ran 50 times a second.

    Raises InputError for a value outside its range.
    """
    require_within(values, _RANGES)
    if values.keys() & set(THRUST_GAINS.values()):
        return _LONGEST_STEP_S
    imu_s = 1.0 / max(values.get(_IMU_RATE, _IMU_HZ), 1.0 / _LONGEST_STEP_S)
    period_s = values.get(_PREDICTION, _PREDICTION_US) / 1e6
    return min(max(imu_s * max(math.floor(period_s / imu_s + 1e-6), 1.0), imu_s), _LONGEST_STEP_S)


def step_parameters(step_s: float) -> dict[str, float]:
    """Parameters with which this is the interval of the estimates, s, of at least 1 ms."""
    return {_PREDICTION: 1e6 * step_s, _IMU_RATE: 1.0 / step_s}


def parameters_from(values: Mapping[str, float]) -> Parameters:
    """Parameters from the firmware's values by name; those missing have their default, other names are ignored.

    Raises InputError that names a value outside its range, or one that the replica lacks.
    """
    if problems := tuple(
        Reason(code=ReasonCode.PARAMETER_UNSUPPORTED, field=name).problem
        for name in UNSUPPORTED
        if not values.get(name, 0.0) <= 0.0
    ):
        raise InputError(
            "The replica has no notch filter of the velocity.",
            hint="Record the loop with the filter off, its default.",
            problems=problems,
        )
    return Parameters().changed(values)
