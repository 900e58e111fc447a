"""How well the replica of an autopilot's loop explains a log, for a person: its facts, table, notes and figures."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.replica_check import Kind, LoopReplica, ReplicaCheck, Signal, SignalResult
from app.core.formatting import NOTHING, format_gains
from app.core.records.trajectory import Overlay, Samples, select_samples
from app.figures.panels import Line, Panel, Plot, Style
from app.log_library.schemas import Facts, PartTexts, ReplicaAnswer, TextTable

_KINDS: Final[Mapping[Kind, str]] = MappingProxyType({"log": "flight log", "trace": "step-by-step trace"})
_CURVE_POINTS: Final = 1000
_MARKS: Final = 200
_IN_FULL: Final = 1e-6


def answer_of(check: ReplicaCheck) -> tuple[ReplicaAnswer, PartTexts]:
    """The answer in numbers, and for a person."""
    gains = "" if check.gains is None else f"{format_gains(check.gains)}, "
    allowed: dict[str, list[str]] = {}
    for signal in check.signals:
        allowed.setdefault(signal.allowance, []).append(signal.name)
    texts = PartTexts(
        answer=check.sentence,
        facts=[Facts(title="Recording", values=[_KINDS[check.kind], f"gains {gains}{check.gains_from}"])],
        table=_table(check),
        notes=[*(f"{', '.join(names)}: {allowance}." for allowance, names in allowed.items()), *check.notes],
    )
    return ReplicaAnswer.view_of(check, agrees=check.passed), texts


def plots_of(check: ReplicaCheck, replica: LoopReplica) -> list[Plot]:
    """Recording and replica overlaid, one panel for each signal, as far as they were compared."""
    panels = {
        name: _panel(name, replica.signals[name], overlay)
        for overlay in check.overlays
        if len(overlay.time_s)
        for name in overlay.recorded
    }
    plots = []
    for title, names in replica.figures:
        drawn = [name for name in names if name in panels]
        found = [
            f"{each.name} {each.verdict}, largest difference {each.largest_difference:.4g} {each.difference_unit}"
            for each in check.signals
            if each.name in drawn
        ]
        if drawn:
            plots.append(
                Plot(
                    title=title,
                    summary=f"Recorded and replica overlaid: {'; '.join(found)}. {replica.note}",
                    x_title="Time in the recording (s)",
                    panels=tuple(panels[name] for name in drawn),
                )
            )
    return plots


def _table(check: ReplicaCheck) -> TextTable:
    are_medians = any(signal.median_difference is not None for signal in check.signals)
    medians = ["Median difference", "Allowed median"] if are_medians else ["Allowed"]
    return TextTable(
        title="Recording and replica",
        columns=["Signal", "Result", "Largest difference", *medians, "Differing samples"],
        rows=[_row(signal, are_medians=are_medians) for signal in check.signals],
    )


def _row(signal: SignalResult, *, are_medians: bool) -> list[str]:
    def difference(value: float | None) -> str:
        return NOTHING if value is None else f"{_brief(value)} {signal.difference_unit}".rstrip()

    first_s, different = signal.first_different_s, signal.different
    where = NOTHING if first_s is None else f"{different} samples, from {first_s:.3f} s"
    return [
        f"{signal.name}, {signal.title.lower()}",
        signal.verdict,
        difference(signal.largest_difference),
        *([difference(signal.median_difference)] if are_medians else []),
        difference(signal.tolerance),
        f"1 sample, at {first_s:.3f} s" if different == 1 else where,
    ]


def _brief(value: float) -> str:
    """Integers in full, others to two digits."""
    if value.is_integer():
        return f"{value:.0f}"
    if value >= _IN_FULL:
        return np.format_float_positional(value, 2, fractional=False, trim="-")
    return f"{value:.2g}".replace("e-0", "e-")


def _panel(name: str, signal: Signal, overlay: Overlay) -> Panel:
    """Curves of a signal, thinned to common times such that both keep their shape and extremes."""
    known = np.flatnonzero(np.isfinite(overlay.recorded[name]) & np.isfinite(overlay.replica[name]))
    time_s, wrong = overlay.time_s[known], np.flatnonzero(overlay.differs[name][known])
    recorded, computed = (
        np.asarray(side[name][known], dtype=np.float64) * signal.scale for side in (overlay.recorded, overlay.replica)
    )
    places = np.arange(len(known), dtype=np.float64)
    kept = np.union1d(*(select_samples(places, values, _CURVE_POINTS) for values in (recorded, computed)))
    marked = wrong if len(wrong) <= _MARKS else wrong[np.linspace(0, len(wrong) - 1, _MARKS).astype(np.int64)]

    def line(name: str, style: Style, values: Samples, rows: NDArray[np.integer], *, marks: bool = False) -> Line:
        x, y = (tuple(np.round(each[rows], 6).tolist()) for each in (time_s, values))
        return Line(name=name, style=style, x=x, y=y, marks=marks)

    return Panel(
        y_title=f"{name} ({signal.unit})" if signal.unit else name,
        digits=signal.digits,
        lines=(
            line("Recorded", "recorded", recorded, kept),
            line("Replica", "replica", computed, kept),
            *([line("Differs", "differs", recorded, marked, marks=True)] if len(marked) else []),
        ),
    )
