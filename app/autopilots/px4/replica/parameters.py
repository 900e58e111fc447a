"""Parameters of PX4's vertical loop, with the firmware's names, and their layout for the compiled step."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.parameter_checks import require_defined, require_within
from app.core.errors import InputError, Problem

STEP_S: Final = 1 / 125
"""Interval of the estimates of position in PX4's own simulation."""

# Indices in the packed parameters.
POSITION_P: Final = 0
VELOCITY_P: Final = 1
VELOCITY_I: Final = 2
VELOCITY_D: Final = 3
CLIMB: Final = 4
DESCENT: Final = 5
THRUST_MIN: Final = 6
THRUST_MAX: Final = 7
HOVER: Final = 8
RAMP_S: Final = 9
SPOOL_S: Final = 10
VELOCITY_GAIN: Final = 11
DERIVATIVE_GAIN: Final = 12
LAND_SPEED: Final = 13
PACKED_SIZE: Final = 14

Packed = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """What the loop depends on; the defaults are the firmware's.

    Thrust is a share of full thrust. The velocity controller's P, the hover thrust and the speed of a landing are
    positive, all others at least 0. A filter of 0 Hz is none; a ramp of 0 s ends at once.
    """

    position_p_1_s: float = 1.0
    velocity_p_1_s: float = 4.0
    velocity_i_1_s2: float = 2.0
    velocity_d: float = 0.0
    climb_m_s: float = 3.0
    descent_m_s: float = 1.5
    thrust_min: float = 0.12
    thrust_max: float = 1.0
    hover_thrust: float = 0.5
    ramp_s: float = 3.0
    spool_s: float = 1.0
    velocity_filter_hz: float = 0.0
    derivative_filter_hz: float = 5.0
    land_speed_m_s: float = 0.7

    def __post_init__(self) -> None:
        require_defined(asdict(self), _POSITIVE, {field: name for name, field in FIRMWARE_NAMES.items()})

    @property
    def gains(self) -> dict[str, float]:
        """The tuned gains by the firmware's names."""
        return {name: getattr(self, FIRMWARE_NAMES[name]) for name in GAINS}

    def packed(self, filter_sample_s: float = STEP_S) -> Packed:
        """Constants for the kernels, shape (PACKED_SIZE,).

        `filter_sample_s` is the mean interval of the estimates until the filters were set up, s, positive.
        """
        packed = np.empty(PACKED_SIZE, dtype=np.float32)
        packed[POSITION_P] = self.position_p_1_s
        packed[VELOCITY_P] = self.velocity_p_1_s
        packed[VELOCITY_I] = self.velocity_i_1_s2
        packed[VELOCITY_D] = self.velocity_d
        packed[CLIMB], packed[DESCENT] = self.climb_m_s, self.descent_m_s
        packed[THRUST_MIN], packed[THRUST_MAX] = self.thrust_min, self.thrust_max
        packed[HOVER] = self.hover_thrust
        packed[RAMP_S] = self.ramp_s
        packed[SPOOL_S] = self.spool_s
        packed[VELOCITY_GAIN] = low_pass_gain(self.velocity_filter_hz, filter_sample_s)
        packed[DERIVATIVE_GAIN] = low_pass_gain(self.derivative_filter_hz, filter_sample_s)
        packed[LAND_SPEED] = self.land_speed_m_s
        return packed


_POSITIVE: Final = frozenset(
    {
        "velocity_p_1_s",
        "land_speed_m_s",
        "hover_thrust",
    }
)

FIRMWARE_NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "MPC_Z_P": "position_p_1_s",
        "MPC_Z_VEL_P_ACC": "velocity_p_1_s",
        "MPC_Z_VEL_I_ACC": "velocity_i_1_s2",
        "MPC_Z_VEL_D_ACC": "velocity_d",
        "MPC_Z_VEL_MAX_UP": "climb_m_s",
        "MPC_Z_VEL_MAX_DN": "descent_m_s",
        "MPC_THR_MIN": "thrust_min",
        "MPC_THR_MAX": "thrust_max",
        "MPC_THR_HOVER": "hover_thrust",
        "MPC_TKO_RAMP_T": "ramp_s",
        "COM_SPOOLUP_TIME": "spool_s",
        "MPC_VEL_LP": "velocity_filter_hz",
        "MPC_VELD_LP": "derivative_filter_hz",
        "MPC_LAND_SPEED": "land_speed_m_s",
    }
)
"""Field of each parameter of the firmware."""

GAINS: Final = ("MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC")

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


_PREDICTION, _IMU_RATE = "EKF2_PREDICT_US", "IMU_INTEG_RATE"
_PREDICTION_US, _IMU_HZ = 10_000.0, 200.0
_LONGEST_STEP_S: Final = 0.02
_RANGES: Final = {_PREDICTION: (0.0, 1e6), _IMU_RATE: (0.0, 1000.0)}
"""With these no step is shorter than 1 ms."""
ESTIMATOR_NAMES: Final = (_PREDICTION, _IMU_RATE)
"""Parameters on which the interval of the estimates depends."""
HOVER_THRUSTS: Final = (0.1, 0.8)
"""Documented range of MPC_THR_HOVER."""
HOVER_RANGE_NAME: Final = "HTE_THR_RANGE"
HOVER_RANGE: Final = 0.2
"""How far the estimated hover thrust may be from MPC_THR_HOVER, by default."""
_HIGHEST_LOW, _LOWEST_HIGH, _HIGHEST = 0.8, 0.2, 0.9
"""Ends of its limits, whatever the parameters are."""
LOOP_NAMES: Final = (*FIRMWARE_NAMES, *UNSUPPORTED, *ESTIMATOR_NAMES, HOVER_RANGE_NAME)
"""All that the loop depends on."""


def estimator_step_s(values: Mapping[str, float]) -> float:
    """Interval of the estimates, s, from the firmware's values by name: whole intervals of the IMU.

    Raises InputError for a value outside its range.
    """
    require_within(values, _RANGES)
    imu_s = 1.0 / max(values.get(_IMU_RATE, _IMU_HZ), 1.0 / _LONGEST_STEP_S)
    period_s = values.get(_PREDICTION, _PREDICTION_US) / 1e6
    return min(max(imu_s * max(math.floor(period_s / imu_s + 1e-6), 1.0), imu_s), _LONGEST_STEP_S)


def step_parameters(step_s: float) -> dict[str, float]:
    """Parameters with which this is the interval of the estimates, s, of at least 1 ms."""
    return {_PREDICTION: 1e6 * step_s, _IMU_RATE: 1.0 / step_s}


def hover_deviation(values: Mapping[str, float]) -> float:
    """HTE_THR_RANGE of the firmware's values by name, or its default. Raises InputError if it is outside its range."""
    require_within(values, {HOVER_RANGE_NAME: (0.0, 1.0)})
    return values.get(HOVER_RANGE_NAME, HOVER_RANGE)


def hover_limits(hover_thrust: float, deviation: float) -> tuple[float, float]:
    """Least and largest hover thrust that the estimator finds, with MPC_THR_HOVER and HTE_THR_RANGE."""
    low, high = hover_thrust - deviation, hover_thrust + deviation
    return min(max(low, 0.0), _HIGHEST_LOW), min(max(high, _LOWEST_HIGH), _HIGHEST)


def parameters_from(values: Mapping[str, float]) -> Parameters:
    """Parameters from the firmware's values by name; those missing have their default, other names are ignored.

    Raises InputError that names a value outside its range, or one that the replica lacks.
    """
    if problems := tuple(Problem(name, "must be 0") for name in UNSUPPORTED if not values.get(name, 0.0) <= 0.0):
        raise InputError(
            "The replica has no notch filter of the velocity.",
            hint="Record the loop with the filter off, its default.",
            problems=problems,
        )
    return Parameters(**{field: values[name] for name, field in FIRMWARE_NAMES.items() if name in values})
