"""A recorded control loop compared with its replica: a sentence, one line for each signal, and what to draw; and what
the check must know of an autopilot."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import BinaryIO, Final, Literal

import numpy as np
from numpy.typing import NDArray

from app.autopilots.recording import Recording
from app.core.formatting import grouped as grouped_by
from app.core.policy import Gains
from app.core.records.trajectory import Overlay, Samples

Kind = Literal["log", "trace"]
Verdict = Literal["exact", "agrees", "differs"]
Values = NDArray[np.int64] | Samples

_ROWS: Final[Mapping[Kind, str]] = MappingProxyType({"log": "logged rows", "trace": "steps"})

grouped = partial(grouped_by, separator="\N{NARROW NO-BREAK SPACE}")


@dataclass(frozen=True, slots=True)
class Signal:
    """A signal of a loop. `scale` converts its recorded values to `unit`, in which it is drawn with `digits` decimals.

    Differences are in `difference_unit`, as recorded, by default `unit`; in a trace they may be at most `tolerance`,
    which `allowance` describes.
    """

    title: str
    unit: str
    digits: int
    tolerance: float = 0.0
    allowance: str = "compared bit for bit"
    difference_unit: str = ""
    scale: float = 1.0


Signals = Mapping[str, Signal]


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalResult:
    """Result of one signal: the largest difference between recording and replica in `difference_unit`, the tolerance,
    the number of samples that differ by more, and the time of the first of these, s. If the signal is judged by its
    median difference, that is given, and the tolerance is the median's."""

    name: str
    title: str
    largest_difference: float
    difference_unit: str
    tolerance: float
    allowance: str
    verdict: Verdict
    different: int
    first_different_s: float | None
    median_difference: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplicaCheck:
    """How well a replica explains a recording: the log of a flight, or a trace with every step.

    `gains` is None if they change; `better_gains` are other gains from which more of the commands follow;
    `first_different_row` counts the rows from 0; each of the `overlays` has signals of common samples.
    """

    kind: Kind
    passed: bool
    sentence: str
    rows: int
    gains: Gains | None
    gains_from: str
    better_gains: Gains | None = None
    notes: Sequence[str]
    signals: Sequence[SignalResult]
    overlays: Sequence[Overlay]
    first_different_row: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopReplica:
    """An autopilot's vertical loop that has a replica, and the comparison with its recordings.

    `figures` holds a title and the signals one below another; `note` is what a reader of its signals must know.
    `check_log` compares a recording in the file of that name, with the gains that a person gave, if any, as text;
    `is_trace` says whether a file with these first bytes is a recorded run of the loop, which `check_trace` compares.
    Both raise InputError that names what is missing, or cannot be read: `gains` if a person has to give them.
    """

    signals: Signals
    figures: Sequence[tuple[str, Sequence[str]]]
    note: str
    check_log: Callable[[Recording, str, str], ReplicaCheck]
    is_trace: Callable[[bytes], bool]
    check_trace: Callable[[BinaryIO, str], ReplicaCheck]


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """Rows of a recording and what the replica computed from the same inputs.

    `time_s` has shape (n,), n ≥ 1; `recorded` and `replica` hold each signal by name, shape (n,). `gains` is None if
    they change within the rows.
    """

    time_s: Samples
    recorded: Mapping[str, Values]
    replica: Mapping[str, Values]
    gains: Gains | None
    notes: Sequence[str] = field(default=())

    @property
    def compared(self) -> "Replay":
        """Of the signals that have a value in any row."""
        names = [name for name, values in self.recorded.items() if np.isfinite(values).any()]
        recorded, replica = ({name: values[name] for name in names} for values in (self.recorded, self.replica))
        return replace(self, recorded=recorded, replica=replica)


def replay_of_log(
    log: object,
    replica: Mapping[str, Samples],
    time_s: Samples,
    *,
    gains: Gains,
    notes: Callable[[Mapping[str, int]], Iterable[str]],
) -> Replay:
    """The rows of a log, which has each signal of the replica, at their times, shape (n,), where the replica has a
    value. `notes` are made of the number of these rows for each signal."""
    recorded = {name: np.where(np.isfinite(values), getattr(log, name), np.nan) for name, values in replica.items()}
    rows = {name: int(np.isfinite(values).sum()) for name, values in recorded.items()}
    return Replay(
        time_s=time_s - time_s[0], recorded=recorded, replica=replica, gains=gains, notes=tuple(notes(rows))
    ).compared


def check_replay(signals: Signals, replay: Replay, *, kind: Kind) -> ReplicaCheck:
    """Compare every signal of every row with the replica, within the tolerance of each signal; NaN equals NaN."""
    apart = {name: _apart(replay.recorded[name], replay.replica[name]) for name in replay.recorded}
    differs = {name: ~(values <= signals[name].tolerance) for name, values in apart.items()}
    overlay = Overlay(replay.time_s, replay.recorded, replay.replica, differs)
    rows = np.flatnonzero(np.logical_or.reduce(list(differs.values())))
    results = [
        signal_result(name, signals[name], overlay, largest_difference=float(values.max()))
        for name, values in apart.items()
    ]
    return ReplicaCheck(
        kind=kind,
        passed=rows.size == 0,
        sentence=_sentence(results, overlay, rows, _ROWS[kind]),
        rows=len(replay.time_s),
        gains=replay.gains,
        gains_from="not constant" if replay.gains is None else "of the recording",
        notes=replay.notes,
        signals=results,
        overlays=(overlay,),
        first_different_row=int(rows[0]) if rows.size else None,
    )


def signal_result(name: str, signal: Signal, overlay: Overlay, *, largest_difference: float) -> SignalResult:
    wrong = np.flatnonzero(overlay.differs[name])
    verdict: Verdict = "differs" if wrong.size else "exact" if largest_difference == 0.0 else "agrees"
    return SignalResult(
        name=name,
        title=signal.title,
        largest_difference=largest_difference,
        difference_unit=signal.difference_unit or signal.unit,
        tolerance=signal.tolerance,
        allowance=signal.allowance,
        verdict=verdict,
        different=int(wrong.size),
        first_different_s=round(float(overlay.time_s[wrong[0]]), 6) if wrong.size else None,
    )


def _apart(recorded: Values, replica: Values) -> Samples:
    """|recorded − replica|, shape (n,); infinite where only one of them is NaN."""
    apart: Samples = np.abs(np.asarray(recorded - replica, dtype=np.float64))
    apart[np.isnan(recorded) & np.isnan(replica)] = 0.0
    apart[np.isnan(apart)] = np.inf
    return apart


def _sentence(results: Sequence[SignalResult], overlay: Overlay, rows: NDArray[np.int64], unit: str) -> str:
    total = grouped(len(overlay.time_s))
    exact = all(signal.tolerance == 0.0 for signal in results)
    met = "exact" if exact else "within the tolerances"
    if not rows.size:
        where = f"all {len(results)} signals" if len(results) > 1 else results[0].name
        return f"The replica agrees: all {total} {unit} are {met} in {where}."
    names = ", ".join(name for name, wrong in overlay.differs.items() if wrong[rows[0]])
    verb = "is" if len(rows) == 1 else "are"
    return (
        f"The replica differs: {grouped(len(rows))} of {total} {unit} {verb} not {met}, the first at "
        f"{overlay.time_s[rows[0]]:.3f} s in {names}."
    )
