"""The rows of an altitude loop that a telemetry log has, at the times of its positions."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from app.autopilots.copter_autopilots import CopterAutopilot
from app.autopilots.recording import Recording, Rows, held
from app.autopilots.segments import Part, jumps
from app.core.analysis.segment import LEAD_S
from app.core.records.trajectory import Samples, Trajectory

_HEARTBEAT_HOLDS_S: Final = 5.0
OFF_GROUND_M: Final = 0.5
_JUMP_M: Final = 0.2
_SAME_TARGET_M: Final = 0.01
_AT_REST_M: Final = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class CopterRows:
    """Signals up, in m and s, shape (n,) each; NaN where they are not known. `time_s` increases. `lean` is the cosine
    of the demanded lean, `is_following` tells the rows with armed motors in the mode with set points."""

    time_s: Samples
    altitude_m: Samples
    climb_rate_m_s: Samples
    throttle: Samples
    lean: Samples
    target_m: Samples
    reference_m: Samples
    is_following: Rows
    is_disarmed: Rows

    @classmethod
    def of(cls, recording: Recording, autopilot: CopterAutopilot) -> Self:
        """Those of a vehicle's reports, which has all that its autopilot needs."""
        columns = recording.columns
        time_s, altitude_m = columns["altitude_m"].time_s, columns["altitude_m"].values
        throttle, lean = (columns[each].beside(time_s) for each in ("demanded_throttle", "lean"))
        target_m = recording.at("target_altitude_m", time_s)
        return cls(
            time_s=time_s,
            altitude_m=altitude_m,
            climb_rate_m_s=columns["climb_rate_m_s"].values,
            throttle=throttle if autopilot.shapes_reference else throttle * lean,
            lean=lean,
            target_m=target_m,
            reference_m=altitude_m + columns["reference_error_m"].beside(time_s)
            if autopilot.shapes_reference
            else target_m,
            is_following=follows(recording, autopilot, time_s),
            is_disarmed=recording.at("is_armed", time_s) == 0.0,
        )

    @property
    def is_known(self) -> Rows:
        """Rows with all signals."""
        signals = (self.altitude_m, self.climb_rate_m_s, self.throttle, self.lean, self.target_m, self.reference_m)
        return np.asarray(np.isfinite(np.sum(signals, axis=0)))

    @property
    def is_off_ground(self) -> Rows:
        """Rows above the place where it last was disarmed; all, before it was."""
        rested = np.maximum.accumulate(np.where(self.is_disarmed, np.arange(len(self.time_s)), -1))
        above_m = self.altitude_m - self.altitude_m[rested]
        return np.asarray((rested < 0) | (above_m > OFF_GROUND_M))

    @property
    def is_reset(self) -> Rows:
        """Rows at which the estimator moved the altitude."""
        return jumps(self.time_s, self.altitude_m, self.climb_rate_m_s, _JUMP_M)

    @property
    def target_rate_m_s(self) -> Samples:
        """How fast the set point moves, shape (n,): in steps."""
        return np.diff(self.target_m, prepend=self.target_m[0]) / np.diff(self.time_s, prepend=self.time_s[0] - 1.0)

    def trajectory(self, part: Part) -> Trajectory:
        """Rows of a part that are all known, with time from its first."""
        rows = slice(*part)
        channels = {
            "altitude_m": self.altitude_m[rows],
            "climb_rate_m_s": self.climb_rate_m_s[rows],
            "throttle": self.throttle[rows],
            "reference_m": self.reference_m[rows],
            "set_point_m": self.target_m[rows],
        }
        return Trajectory(self.time_s[rows] - self.time_s[part[0]], channels, "tlog", "vehicle")


def follows(recording: Recording, autopilot: CopterAutopilot, time_s: Samples) -> Rows:
    """Times, shape (n,), between two heartbeats with armed motors in the mode with set points, or after the last."""
    armed, modes = recording.columns["is_armed"], recording.columns["mode"]
    at_s, is_mode = armed.time_s, [autopilot.number_of_mode(int(mode)) == autopilot.mode for mode in modes.values]
    following = ((armed.values > 0.0) & is_mode).astype(np.float64)
    before = held(at_s, following, time_s, longest_s=_HEARTBEAT_HOLDS_S)
    after = held(-at_s[::-1], following[::-1], -time_s)
    return np.asarray((before == 1.0) & (np.isnan(after) | (after == 1.0)))


def steps_in(trajectory: Trajectory) -> list[int]:
    """Rows at which the set point of a part changes, from the first change before which the vehicle was at rest."""
    time_s, target_m = trajectory.time_s, trajectory["set_point_m"]
    changes = (np.flatnonzero(np.abs(np.diff(target_m)) > _SAME_TARGET_M) + 1).tolist()

    def is_at_rest_before(row: int) -> bool:
        lead = slice(int(np.searchsorted(time_s, time_s[row] - LEAD_S)), row)
        away_m = np.abs(trajectory["reference_m"][lead] - target_m[row - 1])
        return bool(time_s[row] >= LEAD_S and away_m.max() <= _AT_REST_M and np.ptp(target_m[lead]) <= _SAME_TARGET_M)

    first = next((place for place, row in enumerate(changes) if is_at_rest_before(row)), len(changes))
    return changes[first:]
