"""A flight as ArduCopter's log holds it, and its signals at every step of the loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.ardupilot_parameters import Parameters, in_newer_names
from app.core.records.trajectory import Samples

LEAD_S: Final = 2.0
"""Beginning of a segment that is flown, but not scored: the filters' state is not known there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Rows of an uninterrupted part in flight, up, in m and s, shape (n,) each; `time_s` increases, n ≥ 3.

    `z_d_m`, `v_d_m_s`, `a_d_m_s2` are the shaped reference, `v_t_m_s` is the climb rate target, `throttle` the demanded
    share of full thrust and `throttle_filtered` that of the motor step of the same loop.
    """

    time_s: Samples
    z_m: Samples
    v_m_s: Samples
    a_m_s2: Samples
    z_d_m: Samples
    v_d_m_s: Samples
    a_d_m_s2: Samples
    v_t_m_s: Samples
    throttle: Samples
    throttle_filtered: Samples

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def scored(self) -> NDArray[np.bool_]:
        """Rows after the lead, shape (n,)."""
        return np.asarray(self.time_s >= self.time_s[0] + LEAD_S)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedFlight:
    """Segments of one flight with the same parameters. `filter_hz` is the cut-off of the accelerometer's filter,
    `step_s` the duration of a step of the loop. `has_newer_names` if the vehicle's parameters have the names and units
    of release 4.7."""

    parameters: Parameters
    filter_hz: float
    step_s: float
    segments: Sequence[Segment]
    has_newer_names: bool = False

    def named(self, gains: Mapping[str, float]) -> dict[str, float]:
        """Gains by the names and in the units of the vehicle's release."""
        return in_newer_names(gains) if self.has_newer_names else dict(gains)

    @property
    def error_m(self) -> float:
        """Mean distance between reference and altitude, over the scored rows of all segments."""
        return float(np.mean(np.concatenate([np.abs(each.z_d_m - each.z_m)[each.scored] for each in self.segments])))

    @property
    def throttle_mean(self) -> float:
        """Mean throttle of all segments."""
        return float(np.mean(np.concatenate([each.throttle_filtered for each in self.segments])))


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """A segment at every step of the loop, interpolated between its rows: shape (m,), `reference` (m, 3)."""

    time_s: Samples
    reference: Samples
    z_m: Samples
    v_m_s: Samples
    throttle_filtered: Samples


def interpolated(segment: Segment, step_s: float) -> Steps:
    """The segment at every step: each signal with its derivative, where that was logged too."""
    from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

    time_s = np.arange(segment.time_s[0], segment.time_s[-1], step_s)

    def between(values: Samples, rates: Samples) -> Samples:
        return np.asarray(CubicHermiteSpline(segment.time_s, values, rates)(time_s))

    reference = (
        between(segment.z_d_m, segment.v_d_m_s),
        between(segment.v_d_m_s, segment.a_d_m_s2),
        np.interp(time_s, segment.time_s, segment.a_d_m_s2),
    )
    return Steps(
        time_s=time_s,
        reference=np.column_stack(reference),
        z_m=between(segment.z_m, segment.v_m_s),
        v_m_s=between(segment.v_m_s, segment.a_m_s2),
        throttle_filtered=np.asarray(PchipInterpolator(segment.time_s, segment.throttle_filtered)(time_s)),
    )
