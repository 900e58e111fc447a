"""Parameters of ArduCopter's vertical loop, with the firmware's names."""

import csv
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from app.core.control.parameter_checks import ReplicaParameters, parameter
from app.core.errors import InputError, Problem
from app.core.reasons import ReasonCode

STEP_S: Final = 1 / 400
"""One loop at the default SCHED_LOOP_RATE."""
_GRAVITY: Final = 9.80665


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(ReplicaParameters):
    """What the loop depends on.

    Gains of the acceleration controller are per mille of throttle for an acceleration in cm/s²; a filter of 0 Hz is
    none.
    """

    position_p_1_s: float = parameter("PSC_POSZ_P", 1.0, positive=True, gain=True)
    velocity_p_1_s: float = parameter("PSC_VELZ_P", 5.0, gain=True)
    velocity_i_1_s2: float = parameter("PSC_VELZ_I", 0.0)
    velocity_d: float = parameter("PSC_VELZ_D", 0.0)
    velocity_ff_1_s: float = parameter("PSC_VELZ_FF", 0.0)
    velocity_imax_cm_s2: float = parameter("PSC_VELZ_IMAX", 1000.0)
    velocity_error_filter_hz: float = parameter("PSC_VELZ_FLTE", 5.0)
    velocity_derivative_filter_hz: float = parameter("PSC_VELZ_FLTD", 5.0)
    acceleration_p: float = parameter("PSC_ACCZ_P", 0.5, gain=True)
    acceleration_i_1_s: float = parameter("PSC_ACCZ_I", 1.0, gain=True)
    acceleration_d_s: float = parameter("PSC_ACCZ_D", 0.0, gain=True)
    acceleration_ff: float = parameter("PSC_ACCZ_FF", 0.0)
    acceleration_d_ff_s: float = parameter("PSC_ACCZ_D_FF", 0.0)
    acceleration_imax_per_mille: float = parameter("PSC_ACCZ_IMAX", 800.0)
    acceleration_target_filter_hz: float = parameter("PSC_ACCZ_FLTT", 0.0)
    acceleration_error_filter_hz: float = parameter("PSC_ACCZ_FLTE", 20.0)
    acceleration_derivative_filter_hz: float = parameter("PSC_ACCZ_FLTD", 0.0)
    jerk_m_s3: float = parameter("PSC_JERK_Z", 5.0, positive=True)
    climb_m_s: float = parameter("WPNAV_SPEED_UP", 2.5, factor=0.01, positive=True)
    descent_m_s: float = parameter("WPNAV_SPEED_DN", 1.5, factor=0.01, positive=True)
    acceleration_m_s2: float = parameter("WPNAV_ACCEL_Z", 1.0, factor=0.01, positive=True)
    hover_throttle: float = parameter("MOT_THST_HOVER", 0.35)
    takeoff_slew_s: float = parameter("TKOFF_SLEW_TIME", 2.0, positive=True)
    takeoff_throttle: float = parameter("TKOFF_THR_MAX", 0.9)

    @property
    def shaping_jerk_m_s3(self) -> float:
        """Jerk limit of the shaped trajectory: PSC_JERK_Z, and not more than the filters of the acceleration pass."""
        filters_hz = (self.acceleration_target_filter_hz, self.acceleration_error_filter_hz)
        bandwidth = min(_GRAVITY, self.acceleration_m_s2) * 2.0 * math.pi / 5.0
        return min(self.jerk_m_s3, *(bandwidth * filter_hz or math.inf for filter_hz in filters_hz))


DEFAULTS: Final[Mapping[str, float]] = MappingProxyType(Parameters().named)
"""The firmware's, by its names and in its units."""

UNSUPPORTED: Final = ("PSC_VELZ_PDMX", "PSC_ACCZ_PDMX", "PSC_ACCZ_SMAX", "PSC_ACCZ_NTF", "PSC_ACCZ_NEF")
"""Limits and notch filters of the controllers that the replica lacks: they must be 0, as they are by default."""

with (Path(__file__).parent / "newer_names.csv").open(encoding="ascii", newline="") as _rows:
    NEWER_NAMES: Final[Mapping[str, tuple[str, float]]] = MappingProxyType(
        {row["newer"]: (row["older"], float(row["factor"])) for row in csv.DictReader(_rows)}
    )
"""Names since release 4.7, each with the name until 4.6 and the factor from the new value to the old: gains for an
acceleration in m/s² instead of cm/s², throttle as a share instead of per mille, m instead of cm
(<https://ardupilot.org/copter/docs/common-param-name-changes.html>)."""

SINCE_4_7: Final[Mapping[str, tuple[str, float]]] = MappingProxyType(
    {older: (newer, 1.0 / factor) for newer, (older, factor) in NEWER_NAMES.items()}
)
"""Names until release 4.6, each with the later name and the factor from the old value to the new."""

_OTHER_NAMES: Final[Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "POS_Z_P": ("PSC_POSZ_P", 1.0),
        "VEL_Z_P": ("PSC_VELZ_P", 1.0),
        **{f"ACCEL_Z_{each}": (f"PSC_ACCZ_{each}", 1.0) for each in ("P", "I", "D", "FF", "IMAX")},
        **dict.fromkeys(("ACCEL_Z_FILT_HZ", "ACCEL_Z_FILT", "PSC_ACCZ_FILT"), ("PSC_ACCZ_FLTE", 1.0)),
        **NEWER_NAMES,
    }
)
"""All names beside those of releases 4.0 to 4.6: of 3.3 to 3.5, of 3.6, and since 4.7. Gains before 3.3 (THR_ACCEL_P)
are those of another controller."""

LOOP_RATE: Final = "SCHED_LOOP_RATE"
ACCELEROMETER_FILTER: Final = "INS_ACCEL_FILTER"
LOOP_RATE_HZ: Final = 400.0
ACCELEROMETER_FILTER_HZ: Final = 20.0
"""The firmware's defaults."""
LOOP_RATES_HZ: Final = (50.0, 2000.0)
"""Rates of the loop that the firmware allows, with room on both sides."""

LOOP_NAMES: Final = (*DEFAULTS, *UNSUPPORTED, ACCELEROMETER_FILTER, LOOP_RATE)
"""All that the loop depends on, by the older names."""

_SINGLE_PRECISION_DIGITS: Final = 7


def in_older_names(name: str, value: float) -> tuple[str, float]:
    """A parameter by the name and in the unit that it had in releases 4.0 to 4.6; unchanged if it was not renamed."""
    older, factor = _OTHER_NAMES.get(name, (name, 1.0))
    return older, _scaled(value, factor)


def names_of(own: Collection[str]) -> dict[str, tuple[str, float]]:
    """Names of releases 4.0 to 4.6 for which a vehicle whose parameters have its `own` names has another one, with
    that and the factor to its value: those of 4.7 for all, if it has any of them."""
    renamed = ((_OTHER_NAMES[each], each) for each in own if each in _OTHER_NAMES)
    since_4_7 = SINCE_4_7 if NEWER_NAMES.keys() & own else {}
    return {**since_4_7, **{name: (each, 1.0 / factor) for (name, factor), each in renamed}}


def in_newer_names(values: Mapping[str, float], names: Mapping[str, tuple[str, float]] = SINCE_4_7) -> dict[str, float]:
    """Parameters by the names and in the units that they have since release 4.7, or by other `names`; unchanged if they
    were not renamed."""
    renamed = ((*names.get(name, (name, 1.0)), value) for name, value in values.items())
    return {name: _scaled(value, factor) for name, factor, value in renamed}


def in_names_of(values: Mapping[str, float], own: Collection[str]) -> dict[str, float]:
    """Parameters of any release by the names and in the units of a vehicle whose parameters have its `own` names;
    unchanged if it has the name, or the parameter was not renamed."""
    older = dict(in_older_names(*each) for each in values.items() if each[0] not in own)
    return {**in_newer_names(older, names_of(own)), **{name: values[name] for name in values.keys() & own}}


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
        Problem(older, f"must be 0 ({newer} since release 4.7)", code=ReasonCode.PARAMETER_UNSUPPORTED.key)
        for newer, older in unsupported
        if values.get(older)
    ):
        raise InputError(
            "The replica has no limits and notch filters inside the controllers.",
            hint="Record the loop with these parameters at 0, their default.",
            problems=problems,
        )
    return Parameters().changed(values)
