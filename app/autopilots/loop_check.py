"""A recorded control loop compared with its replica, as plain data for storage: sentences, one line for each signal,
and curves; and what the check must know of an autopilot."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from types import MappingProxyType
from typing import BinaryIO, Final, Literal

import numpy as np
from numpy.typing import NDArray

from app.core.records.trajectory import Overlaid, Overlay, Samples, select_samples
from app.logs.formats import Format

Kind = Literal["log", "trace"]
Verdict = Literal["exact", "agrees", "differs"]
FigureName = Literal["reference", "commands"]
Values = NDArray[np.int64] | Samples

_ROWS: Final[Mapping[Kind, str]] = MappingProxyType({"log": "logged rows", "trace": "steps"})

CURVE_POINTS: Final = 1000
MARKS: Final = 200


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
class Result:
    """Everything that a page shows of one check.

    `better_gains` are other gains from which more of the commands follow; `first_different_row` counts the rows of a
    trace from 0; `autopilot` is the name of an entry of the registry.
    """

    kind: Kind
    passed: bool
    sentence: str
    rows: int
    gains: Mapping[str, float] | None
    gains_from: str
    better_gains: Mapping[str, float] | None
    notes: tuple[str, ...]
    signals: tuple[SignalResult, ...]
    curves: Mapping[str, Overlaid]
    autopilot: str = "paparazzi"
    first_different_row: int | None = None

    def as_json(self) -> dict[str, object]:
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """A file to examine: its content and name, the file that was written beside it, and gains that a person gave."""

    stream: BinaryIO
    name: str
    companion: BinaryIO | None = None
    given: Mapping[str, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopCheck:
    """The check of an autopilot whose vertical loop has a replica.

    `recordings` completes the sentence “Give …”; `figures` holds a title and the signals one below another for each
    figure that its recordings have; `note` is what a reader of its signals must know. `log` is the format of its own
    log; `is_trace` says whether a file with these first bytes is a recorded run of its loop. `examine_log`
    and `examine_trace` compare them with the replica and raise InputError that names what cannot be read.
    """

    recordings: str
    signals: Signals
    figures: Mapping[FigureName, tuple[str, tuple[str, ...]]]
    note: str
    log: Format
    is_trace: Callable[[bytes], bool]
    examine_log: Callable[[Upload], Result]
    examine_trace: Callable[[Upload], Result]


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceReplay:
    """A trace and what the replica computed from the same inputs.

    `time_s` has shape (n,), n ≥ 1; `recorded` and `replica` hold each signal by name, shape (n,). `gains` is None if
    they change within the trace.
    """

    time_s: Samples
    recorded: Mapping[str, Values]
    replica: Mapping[str, Values]
    gains: Mapping[str, float] | None
    notes: tuple[str, ...] = field(default=())

    @property
    def compared(self) -> "TraceReplay":
        """Of the signals that have a value in any row."""
        names = [name for name, values in self.recorded.items() if np.isfinite(values).any()]
        recorded, replica = ({name: values[name] for name in names} for values in (self.recorded, self.replica))
        return replace(self, recorded=recorded, replica=replica)


def replay_of_log(
    log: object,
    replica: Mapping[str, Samples],
    time_s: Samples,
    *,
    gains: Mapping[str, float],
    notes: Callable[[Mapping[str, int]], Iterable[str]],
) -> TraceReplay:
    """The rows of a log, which has each signal of the replica, at their times, shape (n,), where the replica has a
    value. `notes` are made of the number of these rows for each signal."""
    recorded = {name: np.where(np.isfinite(values), getattr(log, name), np.nan) for name, values in replica.items()}
    rows = {name: int(np.isfinite(values).sum()) for name, values in recorded.items()}
    return TraceReplay(
        time_s=time_s - time_s[0], recorded=recorded, replica=replica, gains=gains, notes=tuple(notes(rows))
    ).compared


def result_of_trace(signals: Signals, replay: TraceReplay, *, kind: Kind = "trace") -> Result:
    """Compare every signal of every row with the replica, within the tolerance of each signal; NaN equals NaN."""
    apart = {name: _apart(replay.recorded[name], replay.replica[name]) for name in replay.recorded}
    differs = {name: ~(values <= signals[name].tolerance) for name, values in apart.items()}
    overlay = Overlay(replay.time_s, replay.recorded, replay.replica, differs)
    rows = np.flatnonzero(np.logical_or.reduce(list(differs.values())))
    results = tuple(
        signal_result(name, signals[name], overlay, largest_difference=float(values.max()))
        for name, values in apart.items()
    )
    return Result(
        kind=kind,
        passed=rows.size == 0,
        sentence=_trace_sentence(results, overlay, rows, _ROWS[kind]),
        rows=len(replay.time_s),
        gains=replay.gains,
        gains_from="not constant" if replay.gains is None else "of the recording",
        better_gains=None,
        notes=replay.notes,
        signals=results,
        curves=curves(signals, (overlay,)),
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


def curves(signals: Signals, overlays: Iterable[Overlay]) -> dict[str, Overlaid]:
    return {
        name: _curve(name, signals[name], overlay)
        for overlay in overlays
        for name in overlay.recorded
        if len(overlay.time_s)
    }


def grouped(count: int) -> str:
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def _apart(recorded: Values, replica: Values) -> Samples:
    """|recorded − replica|, shape (n,); infinite where only one of them is NaN."""
    apart: Samples = np.abs(np.asarray(recorded - replica, dtype=np.float64))
    apart[np.isnan(recorded) & np.isnan(replica)] = 0.0
    apart[np.isnan(apart)] = np.inf
    return apart


def _trace_sentence(results: tuple[SignalResult, ...], overlay: Overlay, rows: NDArray[np.int64], unit: str) -> str:
    total = grouped(len(overlay.time_s))
    exact = all(signal.tolerance == 0.0 for signal in results)
    met = "exact" if exact else "within the tolerances"
    if not rows.size:
        return f"The replica agrees: all {total} {unit} are {met} in all {len(results)} signals."
    names = ", ".join(name for name, wrong in overlay.differs.items() if wrong[rows[0]])
    verb = "is" if len(rows) == 1 else "are"
    return (
        f"The replica differs: {grouped(len(rows))} of {total} {unit} {verb} not {met}, the first at "
        f"{overlay.time_s[rows[0]]:.3f} s in {names}."
    )


def _curve(name: str, signal: Signal, overlay: Overlay) -> Overlaid:
    """Curves of a signal, thinned to common times such that both keep their shape and extremes."""
    known = np.flatnonzero(np.isfinite(overlay.recorded[name]) & np.isfinite(overlay.replica[name]))
    recorded, replica = (
        np.asarray(values[known], dtype=np.float64) * signal.scale
        for values in (overlay.recorded[name], overlay.replica[name])
    )
    time_s = overlay.time_s[known]
    kept = sorted({*_kept(recorded), *_kept(replica)})
    wrong = np.flatnonzero(overlay.differs[name][known])
    marked = wrong if len(wrong) <= MARKS else wrong[np.linspace(0, len(wrong) - 1, MARKS).astype(np.int64)]
    return Overlaid(
        label=f"{name} ({signal.unit})" if signal.unit else name,
        digits=signal.digits,
        time_s=_rounded(time_s[kept]),
        recorded=_rounded(recorded[kept]),
        replica=_rounded(replica[kept]),
        differing_s=_rounded(time_s[marked]),
        differing=_rounded(recorded[marked]),
    )


def _rounded(values: Samples) -> tuple[float, ...]:
    return tuple(round(float(each), 6) for each in values)


def _kept(values: Samples) -> list[int]:
    return [int(place) for place in select_samples(np.arange(len(values), dtype=np.float64), values, CURVE_POINTS)]
