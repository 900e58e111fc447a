"""A flight of altitude steps over a link as an analysis takes it: what the vehicle reported.

The record has altitude, climb rate, the throttle that the loop demanded, and its reference; not the acceleration, nor
the rates of the reference. The acceleration is the change of the climb rate over a row; the rates follow from the set
points, as each autopilot takes these.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.analysis.segment import LEAD_S, FinerSegment
from app.core.errors import TrajectoryError
from app.core.models.set_points import SetPoints
from app.core.reasons import Reason, ReasonCode, refusal
from app.core.records.trajectory import Samples, Trajectory

_ROW_S: Final = 0.1
CHANNELS: Final = ("altitude_m", "climb_rate_m_s", "throttle", "reference_m")
LARGEST_INTERVAL_S: Final = 0.06
_LEAST_VARIATION: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class FlownSteps:
    """The scored steps of a flight: its set points, and the scored time, s since the command."""

    set_points: SetPoints
    begin_s: float
    end_s: float

    def rows_s(self, row_s: float) -> Samples:
        """Times of the rows, from the lead before the first step to the end, shape (n,)."""
        return np.linspace(self.begin_s - LEAD_S, self.end_s, round((self.end_s - self.begin_s + LEAD_S) / row_s) + 1)

    def steps_s(self, step_s: float) -> Samples:
        """Times of the loop's steps over the same time, shape (m,)."""
        return np.arange(self.begin_s - LEAD_S, self.end_s, step_s)


def whole_steps(step_s: float) -> float:
    """A tenth of a second in whole steps."""
    return round(_ROW_S / step_s) * step_s


def segment_of(
    trajectory: Trajectory,
    rows_s: Samples,
    reference: tuple[Samples, Samples, Samples],
    steps_s: Samples,
    sent: Samples,
    assumed_hover: Samples,
) -> FinerSegment:
    """Its rows; `sent` is what the motors get at `steps_s`, shape (m,) each. The climb rate target is not known."""
    z_m, v_m_s, throttle = (np.interp(rows_s, trajectory.time_s, trajectory[name]) for name in CHANNELS[:3])
    changes = np.diff(v_m_s) / np.diff(rows_s)
    z_d, v_d, a_d = reference
    before_end = steps_s < rows_s[-1]
    return FinerSegment(
        time_s=rows_s,
        z_m=z_m,
        v_m_s=v_m_s,
        a_m_s2=np.append(changes[0], changes),
        z_d_m=z_d,
        v_d_m_s=v_d,
        a_d_m_s2=a_d,
        v_t_m_s=np.full(len(rows_s), np.nan),
        throttle=throttle,
        throttle_filtered=np.interp(rows_s, steps_s, sent),
        assumed_hover=assumed_hover,
        motor_time_s=np.append(steps_s[before_end], rows_s[-1]),
        motor_values=np.append(sent[before_end], sent[-1]),
    )


def require_channels(trajectory: Trajectory, steps: FlownSteps) -> None:
    """Require the channels, often enough. Raises TrajectoryError for the first that does not suffice."""
    for name in CHANNELS:
        if name not in trajectory.channels:
            raise unanswered(Reason(code=ReasonCode.CHANNEL_MISSING, field=name, named=[*trajectory.channels]))
    within = (trajectory.time_s >= steps.begin_s - LEAD_S) & (trajectory.time_s <= steps.end_s)
    if np.ptp(trajectory["throttle"][within]) < _LEAST_VARIATION:
        raise unanswered(Reason(code=ReasonCode.CONSTANT_SIGNAL, field="throttle", named=["throttle"]))
    interval_s = float(np.median(np.diff(trajectory.time_s[within])))
    if interval_s > LARGEST_INTERVAL_S:
        numbers = {"interval_s": interval_s, "needed_s": LARGEST_INTERVAL_S}
        raise unanswered(Reason(code=ReasonCode.SAMPLES_RARE, field="time_s", numbers=numbers))


def unanswered(reason: Reason) -> TrajectoryError:
    """The error for a record that does not suffice."""
    hint = "Request the vehicle's position, throttle and reference at 50 Hz."
    return refusal("This flight cannot be fitted.", hint, [reason])
