"""An uninterrupted part of a logged flight, and its signals at every step of the loop."""

from dataclasses import dataclass, fields, replace
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from app.core.records.trajectory import Samples

LEAD_S: Final = 2.0
"""Beginning of a segment that is flown, but not scored: the filters' state is not known there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Rows of an uninterrupted part in flight, up, in m and s, shape (n,) each; `time_s` increases, n ≥ 3.

    `z_d_m`, `v_d_m_s`, `a_d_m_s2` are the reference as the loop takes it, `v_t_m_s` is the climb rate target,
    `throttle` the demanded share of full thrust, `throttle_filtered` what of it the motors get, and `assumed_hover` the
    throttle that the loop assumes to hover with.
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
    assumed_hover: Samples

    def part(self, rows: NDArray[np.int64]) -> Self:
        """These rows."""
        return replace(self, **{each.name: getattr(self, each.name)[rows] for each in fields(self)})

    @property
    def moves_m_s(self) -> Samples:
        """How fast the altitude of the reference changes, shape (n,)."""
        return self.v_d_m_s

    @property
    def rises_m_s(self) -> Samples:
        """How fast the vehicle climbs, shape (n,), whatever bias its estimate has."""
        return self.v_m_s

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def scored(self) -> NDArray[np.bool_]:
        """Rows after the lead, shape (n,)."""
        return np.asarray(self.time_s >= self.time_s[0] + LEAD_S)

    def motor_throttle(self, time_s: Samples) -> Samples:
        """What the motors get at these times within the segment, shape (m,)."""
        from scipy.interpolate import PchipInterpolator

        return np.asarray(PchipInterpolator(*self.motor_rows)(time_s))

    @property
    def motor_rows(self) -> tuple[Samples, Samples]:
        """What the motors get, shape (k,), and when: increasing times, which begin and end with the rows; k ≥ 3."""
        return self.time_s, self.throttle_filtered

    @property
    def jumps(self) -> Samples:
        """How far the throttle of the motors is from the middle of that before and that behind, at each row, shape
        (n,)."""
        time_s, values = self.motor_rows
        return np.interp(self.time_s, time_s[1:-1], values[1:-1] - 0.5 * (values[2:] + values[:-2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class FinerSegment(Segment):
    """A segment of a log that has the throttle of the motors more often than the rest: at `motor_time_s`, shape (k,),
    which increases and begins and ends with the rows."""

    motor_time_s: Samples
    motor_values: Samples

    @property
    def motor_rows(self) -> tuple[Samples, Samples]:
        return self.motor_time_s, self.motor_values


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """A segment at every step of the loop, interpolated between its rows: shape (m,), `reference` (m, 4) as
    `REFERENCE`."""

    time_s: Samples
    reference: Samples
    z_m: Samples
    v_m_s: Samples
    throttle_filtered: Samples


def interpolated(segment: Segment, step_s: float) -> Steps:
    """The segment at every step: each signal with its derivative, where that was logged too."""
    from scipy.interpolate import CubicHermiteSpline

    time_s = np.arange(segment.time_s[0], segment.time_s[-1], step_s)

    def between(values: Samples, rates: Samples) -> Samples:
        return np.asarray(CubicHermiteSpline(segment.time_s, values, rates)(time_s))

    reference = (
        between(segment.z_d_m, segment.moves_m_s),
        between(segment.v_d_m_s, segment.a_d_m_s2),
        np.interp(time_s, segment.time_s, segment.a_d_m_s2),
        np.interp(time_s, segment.time_s, segment.assumed_hover),
    )
    return Steps(
        time_s=time_s,
        reference=np.column_stack(reference),
        z_m=between(segment.z_m, segment.v_m_s),
        v_m_s=between(segment.v_m_s, segment.a_m_s2),
        throttle_filtered=segment.motor_throttle(time_s),
    )
