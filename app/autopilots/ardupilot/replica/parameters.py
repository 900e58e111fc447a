"""Parameters of ArduCopter's vertical loop, with the firmware's names, and their layout for the compiled step."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.parameter_checks import require_defined
from app.core.errors import InputError, Problem

STEP_S: Final = 1 / 400
"""One loop at the default SCHED_LOOP_RATE."""

_GRAVITY: Final = 9.80665
_THROTTLE_FILTER_HZ: Final = 2.0
_RELAXATION_S: Final = 0.16
_RAMP_END: Final = 0.9
HOVER_MIN: Final = 0.125
HOVER_MAX: Final = 0.6875

# Indices in the packed parameters.
DT: Final = 0
CLIMB: Final = 1
DESCENT: Final = 2
ACCELERATION: Final = 3
JERK: Final = 4
HOVER: Final = 5
POSITION_P: Final = 6
VELOCITY_P: Final = 7
VELOCITY_I: Final = 8
VELOCITY_D: Final = 9
VELOCITY_FF: Final = 10
VELOCITY_IMAX: Final = 11
VELOCITY_ERROR_GAIN: Final = 12
VELOCITY_DERIVATIVE_GAIN: Final = 13
ACCELERATION_P: Final = 14
ACCELERATION_I: Final = 15
ACCELERATION_D: Final = 16
ACCELERATION_FF: Final = 17
ACCELERATION_D_FF: Final = 18
ACCELERATION_IMAX: Final = 19
TARGET_GAIN: Final = 20
ACCELERATION_ERROR_GAIN: Final = 21
ACCELERATION_DERIVATIVE_GAIN: Final = 22
THROTTLE_GAIN: Final = 23
RELAXATION_GAIN: Final = 24
RAMP_STEP: Final = 25
RAMP_END: Final = 26
PACKED_SIZE: Final = 27

Packed = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """What the loop depends on; the defaults are the firmware's.

    The position controller's gain and the speeds, the acceleration, the jerk and the slew time are positive, all others
    at least 0. Gains of the acceleration controller are per mille of throttle for an acceleration in cm/s²; a filter of
    0 Hz is none.
    """

    position_p_1_s: float = 1.0
    velocity_p_1_s: float = 5.0
    velocity_i_1_s2: float = 0.0
    velocity_d: float = 0.0
    velocity_ff_1_s: float = 0.0
    velocity_imax_cm_s2: float = 1000.0
    velocity_error_filter_hz: float = 5.0
    velocity_derivative_filter_hz: float = 5.0
    acceleration_p: float = 0.5
    acceleration_i_1_s: float = 1.0
    acceleration_d_s: float = 0.0
    acceleration_ff: float = 0.0
    acceleration_d_ff_s: float = 0.0
    acceleration_imax_per_mille: float = 800.0
    acceleration_target_filter_hz: float = 0.0
    acceleration_error_filter_hz: float = 20.0
    acceleration_derivative_filter_hz: float = 0.0
    climb_m_s: float = 2.5
    descent_m_s: float = 1.5
    acceleration_m_s2: float = 1.0
    jerk_m_s3: float = 5.0
    hover_throttle: float = 0.35
    takeoff_slew_s: float = 2.0
    takeoff_throttle: float = 0.9

    def __post_init__(self) -> None:
        require_defined(asdict(self), _POSITIVE, {field: name for name, (field, _) in FIRMWARE_NAMES.items()})

    @property
    def shaping_jerk_m_s3(self) -> float:
        """Jerk limit of the shaped trajectory: PSC_JERK_Z, and not more than the filters of the acceleration pass."""
        filters_hz = (self.acceleration_target_filter_hz, self.acceleration_error_filter_hz)
        bandwidth = min(_GRAVITY, self.acceleration_m_s2) * 2.0 * math.pi / 5.0
        return min(self.jerk_m_s3, *(bandwidth * filter_hz or math.inf for filter_hz in filters_hz))

    @property
    def gains(self) -> dict[str, float]:
        """The tuned gains by the firmware's names."""
        return {name: getattr(self, FIRMWARE_NAMES[name][0]) for name in GAINS}

    def packed(self, dt_s: float = STEP_S) -> Packed:
        """Constants of a step of `dt_s`, shape (PACKED_SIZE,), for the kernels."""
        packed = np.empty(PACKED_SIZE)
        packed[DT] = dt_s
        packed[[CLIMB, DESCENT, ACCELERATION]] = self.climb_m_s, self.descent_m_s, self.acceleration_m_s2
        packed[JERK] = self.shaping_jerk_m_s3
        packed[HOVER] = hover = min(max(self.hover_throttle, HOVER_MIN), HOVER_MAX)
        packed[POSITION_P] = self.position_p_1_s
        packed[VELOCITY_P] = self.velocity_p_1_s
        packed[VELOCITY_I] = self.velocity_i_1_s2
        packed[VELOCITY_D] = self.velocity_d
        packed[VELOCITY_FF] = self.velocity_ff_1_s
        packed[VELOCITY_IMAX] = self.velocity_imax_cm_s2
        packed[VELOCITY_ERROR_GAIN] = low_pass_gain(self.velocity_error_filter_hz, dt_s)
        packed[VELOCITY_DERIVATIVE_GAIN] = low_pass_gain(self.velocity_derivative_filter_hz, dt_s)
        packed[ACCELERATION_P] = self.acceleration_p
        packed[ACCELERATION_I] = self.acceleration_i_1_s
        packed[ACCELERATION_D] = self.acceleration_d_s
        packed[ACCELERATION_FF] = self.acceleration_ff
        packed[ACCELERATION_D_FF] = self.acceleration_d_ff_s
        packed[ACCELERATION_IMAX] = max(self.acceleration_imax_per_mille, 1000.0 * hover)
        packed[TARGET_GAIN] = low_pass_gain(self.acceleration_target_filter_hz, dt_s)
        packed[ACCELERATION_ERROR_GAIN] = low_pass_gain(self.acceleration_error_filter_hz, dt_s)
        packed[ACCELERATION_DERIVATIVE_GAIN] = low_pass_gain(self.acceleration_derivative_filter_hz, dt_s)
        packed[THROTTLE_GAIN] = low_pass_gain(_THROTTLE_FILTER_HZ, dt_s)
        packed[RELAXATION_GAIN] = dt_s / (dt_s + _RELAXATION_S)
        packed[RAMP_STEP] = dt_s / self.takeoff_slew_s
        packed[RAMP_END] = min(self.takeoff_throttle, _RAMP_END)
        return packed


_POSITIVE: Final = frozenset(
    {"position_p_1_s", "climb_m_s", "descent_m_s", "acceleration_m_s2", "jerk_m_s3", "takeoff_slew_s"}
)

FIRMWARE_NAMES: Final[Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "PSC_POSZ_P": ("position_p_1_s", 1.0),
        "PSC_VELZ_P": ("velocity_p_1_s", 1.0),
        "PSC_VELZ_I": ("velocity_i_1_s2", 1.0),
        "PSC_VELZ_D": ("velocity_d", 1.0),
        "PSC_VELZ_FF": ("velocity_ff_1_s", 1.0),
        "PSC_VELZ_IMAX": ("velocity_imax_cm_s2", 1.0),
        "PSC_VELZ_FLTE": ("velocity_error_filter_hz", 1.0),
        "PSC_VELZ_FLTD": ("velocity_derivative_filter_hz", 1.0),
        "PSC_ACCZ_P": ("acceleration_p", 1.0),
        "PSC_ACCZ_I": ("acceleration_i_1_s", 1.0),
        "PSC_ACCZ_D": ("acceleration_d_s", 1.0),
        "PSC_ACCZ_FF": ("acceleration_ff", 1.0),
        "PSC_ACCZ_D_FF": ("acceleration_d_ff_s", 1.0),
        "PSC_ACCZ_IMAX": ("acceleration_imax_per_mille", 1.0),
        "PSC_ACCZ_FLTT": ("acceleration_target_filter_hz", 1.0),
        "PSC_ACCZ_FLTE": ("acceleration_error_filter_hz", 1.0),
        "PSC_ACCZ_FLTD": ("acceleration_derivative_filter_hz", 1.0),
        "PSC_JERK_Z": ("jerk_m_s3", 1.0),
        "WPNAV_SPEED_UP": ("climb_m_s", 0.01),
        "WPNAV_SPEED_DN": ("descent_m_s", 0.01),
        "WPNAV_ACCEL_Z": ("acceleration_m_s2", 0.01),
        "MOT_THST_HOVER": ("hover_throttle", 1.0),
        "TKOFF_SLEW_TIME": ("takeoff_slew_s", 1.0),
        "TKOFF_THR_MAX": ("takeoff_throttle", 1.0),
    }
)
"""Field of each parameter of the firmware, and the factor from its value to the field's."""

GAINS: Final = ("PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_I", "PSC_ACCZ_D")

UNSUPPORTED: Final = ("PSC_VELZ_PDMX", "PSC_ACCZ_PDMX", "PSC_ACCZ_SMAX", "PSC_ACCZ_NTF", "PSC_ACCZ_NEF")
"""Limits and notch filters of the controllers that the replica lacks: they must be 0, as they are by default."""

NEWER_NAMES: Final[Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "PSC_D_POS_P": ("PSC_POSZ_P", 1.0),
        "PSC_D_VEL_P": ("PSC_VELZ_P", 1.0),
        "PSC_D_VEL_I": ("PSC_VELZ_I", 1.0),
        "PSC_D_VEL_D": ("PSC_VELZ_D", 1.0),
        "PSC_D_VEL_FF": ("PSC_VELZ_FF", 1.0),
        "PSC_D_VEL_IMAX": ("PSC_VELZ_IMAX", 100.0),
        "PSC_D_VEL_FLTE": ("PSC_VELZ_FLTE", 1.0),
        "PSC_D_VEL_FLTD": ("PSC_VELZ_FLTD", 1.0),
        "PSC_D_VEL_PDMX": ("PSC_VELZ_PDMX", 1.0),
        "PSC_D_ACC_P": ("PSC_ACCZ_P", 10.0),
        "PSC_D_ACC_I": ("PSC_ACCZ_I", 10.0),
        "PSC_D_ACC_D": ("PSC_ACCZ_D", 10.0),
        "PSC_D_ACC_FF": ("PSC_ACCZ_FF", 10.0),
        "PSC_D_ACC_D_FF": ("PSC_ACCZ_D_FF", 10.0),
        "PSC_D_ACC_IMAX": ("PSC_ACCZ_IMAX", 1000.0),
        "PSC_D_ACC_FLTT": ("PSC_ACCZ_FLTT", 1.0),
        "PSC_D_ACC_FLTE": ("PSC_ACCZ_FLTE", 1.0),
        "PSC_D_ACC_FLTD": ("PSC_ACCZ_FLTD", 1.0),
        "PSC_D_ACC_PDMX": ("PSC_ACCZ_PDMX", 1.0),
        "PSC_D_ACC_SMAX": ("PSC_ACCZ_SMAX", 1.0),
        "PSC_D_ACC_NTF": ("PSC_ACCZ_NTF", 1.0),
        "PSC_D_ACC_NEF": ("PSC_ACCZ_NEF", 1.0),
        "PSC_D_JERK": ("PSC_JERK_Z", 1.0),
        "PSC_JERK_D": ("PSC_JERK_Z", 1.0),
        "WP_SPD_UP": ("WPNAV_SPEED_UP", 100.0),
        "WP_SPD_DN": ("WPNAV_SPEED_DN", 100.0),
        "WP_ACC_Z": ("WPNAV_ACCEL_Z", 100.0),
    }
)
"""Names since release 4.7, each with the name until 4.6 and the factor from the new value to the old: gains for an
acceleration in m/s² instead of cm/s², throttle as a share instead of per mille, m instead of cm
(<https://ardupilot.org/copter/docs/common-param-name-changes.html>)."""

LOOP_RATE: Final = "SCHED_LOOP_RATE"
ACCELEROMETER_FILTER: Final = "INS_ACCEL_FILTER"
LOOP_RATE_HZ: Final = 400.0
ACCELEROMETER_FILTER_HZ: Final = 20.0
"""The firmware's defaults."""
LOOP_RATES_HZ: Final = (50.0, 2000.0)
"""Rates of the loop that the firmware allows, with room on both sides."""

LOOP_NAMES: Final = (*FIRMWARE_NAMES, *UNSUPPORTED, ACCELEROMETER_FILTER, LOOP_RATE)
"""All that the loop depends on, by the older names."""

_SINGLE_PRECISION_DIGITS: Final = 7


def in_older_names(name: str, value: float) -> tuple[str, float]:
    """A parameter by the name and in the unit that it had until release 4.6; unchanged if it was not renamed."""
    older, factor = NEWER_NAMES.get(name, (name, 1.0))
    return older, _scaled(value, factor)


def in_newer_names(values: Mapping[str, float]) -> dict[str, float]:
    """Parameters by the names and in the units that they have since release 4.7; unchanged if they were not renamed."""
    newer = {older: (name, 1.0 / factor) for name, (older, factor) in NEWER_NAMES.items()}
    renamed = {name: newer.get(name, (name, 1.0)) for name in values}
    return {renamed[name][0]: _scaled(value, renamed[name][1]) for name, value in values.items()}


def _scaled(value: float, factor: float) -> float:
    return value if factor == 1.0 else float(f"{value * factor:.{_SINGLE_PRECISION_DIGITS}g}")


def low_pass_gain(cutoff_hz: float, dt_s: float) -> float:
    """Share of the input that a first-order low-pass adopts per step of `dt_s`, 0 … 1; 1 for a cut-off of 0."""
    return dt_s / (dt_s + 1.0 / (2.0 * math.pi * cutoff_hz)) if cutoff_hz > 0.0 else 1.0


def parameters_from(values: Mapping[str, float]) -> Parameters:
    """Parameters from the firmware's values by name; those missing have their default, other names are ignored.

    Raises InputError that names a value outside its range, or one that the replica lacks.
    """
    unsupported = [(newer, older) for newer, (older, _) in NEWER_NAMES.items() if older in UNSUPPORTED]
    if problems := tuple(
        Problem(older, f"must be 0 ({newer} since release 4.7)") for newer, older in unsupported if values.get(older)
    ):
        raise InputError(
            "The replica has no limits and notch filters inside the controllers.",
            hint="Record the loop with these parameters at 0, their default.",
            problems=problems,
        )
    return Parameters(
        **{field: values[name] * factor for name, (field, factor) in FIRMWARE_NAMES.items() if name in values}
    )
