"""Check of the replica against a log of the vertical loop that was sampled far below its 512 Hz.

The check has two parts. A sample contains the inputs of its own commands, so the commands must follow exactly, apart
from one step of 1/512 s between fields that were collected around a step boundary. The other part is in `simulation`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control import vertical_guidance as loop
from app.core.policy import Gains
from app.core.records.trajectory import Overlay, Samples

FIELDS: Final = (
    "z_sp", "zd_sp", "z", "zd", "zdd", "z_ref", "zd_ref", "zdd_ref",
    "adapt_X", "adapt_P", "adapt_Xmeas", "z_sum_err", "ff_cmd", "fb_cmd", "thrust",
)  # fmt: skip
GAINS: Final = ("kp", "ki", "kd")

STALE_FIELDS: Final = ("state", "reference", "integrator")
COMMANDS: Final = ("ff_cmd", "fb_cmd", "thrust")

_ROUNDING: Final = 1
_TILT_ROUNDING: Final = 3
_R33_MAX: Final = loop.LEVEL + 1
"""The firmware computes r33 from an attitude quaternion whose elements are rounded to 15 bits, which may make it one
count longer than 1."""
_NEAR: Final = 4
_FEWEST_TO_INFER: Final = 20
_MAX_TO_INFER: Final = 2000
_MOST_FLIGHTS: Final = 20
_MOST_CHANGES: Final = 200
_NEXT_SAMPLES: Final = 20

Counts = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class LoopLog:
    """Samples of the loop.

    `time_s` has shape (n,) and increases; `values` has shape (n, 15) in the order of `FIELDS`, 32-bit integers with the
    loop's own fractions, z down; n ≥ 1.
    """

    time_s: Samples
    values: Counts

    def __getitem__(self, name: str) -> Counts:
        return self.values[:, FIELDS.index(name)]

    def __len__(self) -> int:
        return len(self.time_s)

    def part(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> "LoopLog":
        """These rows."""
        return LoopLog(self.time_s[rows], self.values[rows])

    @property
    def idle(self) -> NDArray[np.bool_]:
        """Samples in which the loop only tracks the vehicle and commands nothing itself, shape (n,)."""
        idle: NDArray[np.bool_] = (self["z_ref"] == self["z"]) & (self["zd_ref"] == self["zd"]) & (self["zdd_ref"] == 0)
        return idle


@dataclass(frozen=True, slots=True)
class FlownGains:
    """Gains that the loop used after a time, until the next ones; None if its commands follow from none that are
    known."""

    after_s: float
    gains: Gains | None


@dataclass(frozen=True, slots=True)
class CommandCheck:
    """Result of checking each sample's commands against the sample itself.

    `exact` samples agree to the last bit; `tilted` of these with a tilt of up to `largest_tilt_deg`, `rounded` with an
    r33 that rounding made one count larger than level. `stale` counts the samples that agree only if the named fields
    are one step old or new. `different` samples have no explanation; `first_different_s` is the time of the first.
    `overlay` has both sides of `COMMANDS`.
    """

    rows: int
    exact: int
    tilted: int
    rounded: int
    largest_tilt_deg: float
    stale: Mapping[str, int]
    different: int
    first_different_s: float | None
    overlay: Overlay

    @property
    def passed(self) -> bool:
        return self.rows > 0 and not self.different


def compare_commands(log: LoopLog, flown: Sequence[FlownGains]) -> CommandCheck:
    """Compare ff_cmd, fb_cmd and thrust of every active sample with the values computed from the sample itself and the
    gains flown then, of which at least one set is known."""
    sample = log.part(~log.idle)
    gains, r33 = _gains_of_rows(sample, flown), _r33(sample)
    replica = _replica_commands(sample, gains, r33)
    sums = sample["thrust"] == np.clip(sample["ff_cmd"] + sample["fb_cmd"], 0, loop.FULL_THRUST)
    exact = (r33 > 0) & (replica["fb_cmd"] == sample["fb_cmd"]) & sums
    left = ~exact
    stale: dict[str, int] = {}
    for fields in STALE_FIELDS:
        slack = _feed_forward_change(sample) if fields == "reference" else 0
        explained = left & sums & _follows_shifted(sample, gains, _shifted(sample, fields))
        explained &= np.abs(sample["ff_cmd"] - replica["ff_cmd"]) <= slack
        stale[fields] = int(explained.sum())
        left &= ~explained
    tilted = exact & (r33 < loop.LEVEL)
    recorded = {name: sample[name] for name in COMMANDS}
    differs = {name: left & (replica[name] != recorded[name]) for name in COMMANDS}
    return CommandCheck(
        rows=len(sample),
        exact=int(exact.sum()),
        tilted=int(tilted.sum()),
        rounded=int((exact & (r33 > loop.LEVEL)).sum()),
        largest_tilt_deg=float(np.degrees(np.arccos(r33[tilted] / loop.LEVEL)).max(initial=0.0)),
        stale=stale,
        different=int(left.sum()),
        first_different_s=float(sample.time_s[left][0]) if left.any() else None,
        overlay=Overlay(sample.time_s, recorded, replica, differs),
    )


def flown_gains(log: LoopLog, candidates: Sequence[Gains]) -> list[FlownGains]:
    """Which gains the loop used when, from its commands: of the `candidates`, and of those inferred from each flight.

    A change is dated before the first sample that does not follow from the gains before it, or as much earlier in that
    flight as the samples follow from both. None are known where at most half of the next 20 samples follow from any.
    Empty if the loop was never active.
    """
    active = np.flatnonzero(~log.idle)
    if not len(active):
        return []
    starts = np.flatnonzero(np.diff(active, prepend=-2) > 1)
    flights = sorted(np.split(active, starts[1:]), key=len, reverse=True)[:_MOST_FLIGHTS]
    inferred = filter(None, (infer_gains(log.part(each)) for each in flights))
    distinct = {tuple(_row(each)): each for each in (*candidates, *inferred)}.values()
    follows, near, best = _fitting(log.part(active), list(distinct))
    known = [*distinct, None]

    def replaced(now: int) -> NDArray[np.intp]:
        return np.flatnonzero((best != now) & ~follows[now] & ((best < len(distinct)) | ~near[now]))

    row, now = 0, int(best[0])
    flown = [FlownGains(float(log.time_s[0]), known[now])]
    while len(flown) < _MOST_CHANGES and len(later := (rows := replaced(now))[rows > row]):
        row = int(later[0])
        now = int(best[row])
        flight = starts[starts <= row][-1]
        apart = np.flatnonzero(~follows[now, flight:row])
        first = flight + (int(apart[-1]) + 1 if len(apart) else 0)
        flown.append(FlownGains(float(log.time_s[max(active[first] - 1, 0)]), known[now]))
    return flown


def infer_gains(log: LoopLog) -> dict[str, float] | None:
    """Infer the integer gains from the log.

    They are those that reproduce the feedback of more samples than any neighbours, and of most samples. The search
    starts near a least squares fit on the three errors. None if the flight cannot distinguish neighbouring gains.
    """
    active = np.flatnonzero(~log.idle)
    if len(active) < _FEWEST_TO_INFER:
        return None
    active = active[:: max(1, len(active) // _MAX_TO_INFER)]
    sample = LoopLog(log.time_s[active], log.values[active])
    ez, ev = _errors(sample)
    parts = np.column_stack([-ez / 2**7, -sample["z_sum_err"] / 2**16, -ev / 2**16, np.ones(len(sample))])
    fitted = np.linalg.lstsq(parts, sample["fb_cmd"].astype(np.float64), rcond=None)[0][:3]
    if not (np.abs(fitted) < 2**20).all():
        return None
    around = product(*(range(round(each) - _NEAR, round(each) + _NEAR + 1) for each in fitted.tolist()))
    candidates = [np.array(each) for each in around if min(each) >= 0]
    followed = [int((_feedback(each, ez, ev, sample["z_sum_err"]) == sample["fb_cmd"]).sum()) for each in candidates]
    most = max(followed, default=0)
    unique = followed.count(most) == 1 and most > len(sample) / 2
    return dict(zip(GAINS, map(float, candidates[followed.index(most)]), strict=True)) if unique else None


def _wrap32(values: Counts) -> Counts:
    return ((values + 2**31) & 0xFFFFFFFF) - 2**31


def _errors(sample: LoopLog) -> tuple[Counts, Counts]:
    ez = np.clip(_wrap32(sample["z_ref"] - sample["z"]), -loop.POSITION_ERROR_MAX, loop.POSITION_ERROR_MAX)
    ev = np.clip(_wrap32(sample["zd_ref"] - sample["zd"]), -loop.SPEED_ERROR_MAX, loop.SPEED_ERROR_MAX)
    return ez, ev


def _row(gains: Gains) -> Counts:
    return np.array([int(gains[name]) for name in GAINS])


def _gains_of_rows(sample: LoopLog, flown: Sequence[FlownGains]) -> Counts:
    """Gains of every sample, shape (n, 3); those before where none are known, or else those after."""
    known = [each for each in flown if each.gains is not None]
    places = np.searchsorted([each.after_s for each in known], sample.time_s) - 1
    return np.array([_row(each.gains) for each in known if each.gains])[np.maximum(places, 0)]


def _fitting(sample: LoopLog, known: Sequence[Gains]) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.intp]]:
    """Which samples follow from which gains, possibly with fields one step apart, and whether most of the next samples
    do, both of shape (k + 1, n), the last row False; and the gains that explain a sample and the most after it, shape
    (n,), k for none."""
    none = np.zeros(len(sample), dtype=np.bool_)
    errors = (*_errors(sample), sample["z_sum_err"])
    exact = np.array([*(_feedback(_row(each), *errors) == sample["fb_cmd"] for each in known), none])
    shifted = [each for fields in STALE_FIELDS for each in _shifted(sample, fields)]
    follows = exact | np.array([*(_follows_shifted(sample, _row(each), shifted) for each in known), none])
    rows = np.arange(len(sample))
    past = np.minimum(rows + _NEXT_SAMPLES, len(sample))
    counted = np.pad(np.cumsum(follows, axis=1, dtype=np.int32), ((0, 0), (1, 0)))
    near = 2 * (counted[:, past] - counted[:, rows]) > past - rows
    later = np.cumsum((exact.astype(np.int8) + follows)[:, ::-1], axis=1, dtype=np.int32)[:, ::-1]
    explained = np.where(follows & near, later, 0)
    return follows, near, np.where(explained.any(axis=0), explained.argmax(axis=0), len(known))


def _feedback(gains: Counts, ez: Counts, ev: Counts, z_sum_err: Counts) -> Counts:
    """Feedback of samples, shape (n,), with gains of shape (3,) or (n, 3)."""
    kp, ki, kd = gains.T
    return _wrap32((_wrap32(-kp * ez) >> 7) + (_wrap32(-kd * ev) >> 16) + (_wrap32(-ki * z_sum_err) >> 16))


def _replica_commands(sample: LoopLog, gains: Counts, r33: Counts) -> dict[str, Counts]:
    """Commands of the replica for every sample, shape (n,) each; at the sample's r33 if one explains it, else level."""
    level = np.array([loop.feed_forward(value, loop.LEVEL) for value in sample["zdd_ref"].tolist()], dtype=np.int64)
    forward = np.where(r33 > 0, sample["ff_cmd"], level)
    back = _feedback(gains, *_errors(sample), sample["z_sum_err"])
    return {"ff_cmd": forward, "fb_cmd": back, "thrust": np.clip(forward + back, 0, loop.FULL_THRUST)}


def _r33(sample: LoopLog) -> Counts:
    """Element r33 of the rotation matrix with which ff_cmd follows from zdd_ref, shape (n,): level if that explains it,
    another one of a tilt up to 60°, or 0 for none."""
    found = np.zeros(len(sample), dtype=np.int64)
    for row, (zdd_ref, ff_cmd) in enumerate(zip(sample["zdd_ref"].tolist(), sample["ff_cmd"].tolist(), strict=True)):
        level = loop.feed_forward(zdd_ref, loop.LEVEL)
        if level == ff_cmd:
            found[row] = loop.LEVEL
        elif ff_cmd:
            about = level * loop.LEVEL // ff_cmd
            for r33 in range(about - _TILT_ROUNDING, about + _TILT_ROUNDING + 1):
                if loop.LEVEL // 2 <= r33 <= _R33_MAX and loop.feed_forward(zdd_ref, r33) == ff_cmd:
                    found[row] = r33
    return found


def _shifted(sample: LoopLog, fields: str) -> list[tuple[Counts, Counts, Counts]]:
    """Errors of position and speed, and the integrator, with these fields one step older or newer, shape (n,) each.

    A step changes a position by its speed, rounded to a count, a speed by exactly its acceleration, and the integrator
    by its error.
    """
    shifts = []
    for direction, rounding in product((-1, 1), (-1, 0, 1)):
        moved = sample.values.copy()
        if fields == "integrator":
            moved[:, FIELDS.index("z_sum_err")] += direction * _errors(sample)[0] + rounding
        else:
            suffix = "_ref" if fields == "reference" else ""
            z, zd, zdd = (f"{name}{suffix}" for name in ("z", "zd", "zdd"))
            moved[:, FIELDS.index(z)] += direction * (sample[zd] >> 20) + rounding
            moved[:, FIELDS.index(zd)] += direction * sample[zdd]
        other = LoopLog(sample.time_s, moved)
        shifts.append((*_errors(other), other["z_sum_err"]))
    return shifts


def _follows_shifted(
    sample: LoopLog, gains: Counts, shifts: Sequence[tuple[Counts, Counts, Counts]]
) -> NDArray[np.bool_]:
    """Samples whose fb_cmd follows from one of these shifts, shape (n,)."""
    apart = np.array([np.abs(sample["fb_cmd"] - _feedback(gains, *each)) for each in shifts])
    follows: NDArray[np.bool_] = apart.min(axis=0) <= _ROUNDING
    return follows


def _feed_forward_change(sample: LoopLog) -> Counts:
    """How far ff_cmd moves in one step: 2ζω and ω² are both 3 per s, one count of acceleration is 0.63 of thrust."""
    change = 3.1 / loop.RATE_HZ * (np.abs(sample["zdd_ref"]) + np.abs(sample["zd_ref"]) / 2**9)
    return np.ceil(0.63 * change).astype(np.int64) + _ROUNDING
