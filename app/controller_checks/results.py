"""Result of a check as plain data for storage: sentences, one line for each signal, and curves."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from io import BytesIO
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from app.controller_checks.check import LogCheck, TraceCheck, check_recording
from app.core.control.loop_log import COMMANDS, GAINS, SIMULATED, TIME_TOLERANCE_S, TOLERANCES, CommandCheck, Overlay
from app.core.control.loop_log import UNITS as REFERENCE_UNITS
from app.core.control.paparazzi import INPUTS, OUTPUTS, RATE_HZ
from app.core.formatting import format_gains
from app.core.records.trajectory import Samples
from app.figures.panels import Overlaid
from app.figures.scale import thinned

Kind = Literal["log", "trace"]
Verdict = Literal["exact", "agrees", "differs"]
Values = NDArray[np.int64] | Samples

CURVE_POINTS: Final = 1000
MARKS: Final = 200


@dataclass(frozen=True, slots=True)
class _Shown:
    """Title and scale of a signal: `scale` converts its counts to `unit`."""

    title: str
    unit: str
    scale: float
    digits: int


_SHOWN: Final[Mapping[str, _Shown]] = MappingProxyType(
    {
        "z_ref": _Shown("Reference altitude", "m", REFERENCE_UNITS["z_ref"], 3),
        "zd_ref": _Shown("Reference speed", "m/s", REFERENCE_UNITS["zd_ref"], 3),
        "zdd_ref": _Shown("Reference acceleration", "m/s²", REFERENCE_UNITS["zdd_ref"], 2),
        "z_sum_err": _Shown("Summed error", "m·s", REFERENCE_UNITS["z_ref"] / RATE_HZ, 3),
        "ff_cmd": _Shown("Feed-forward", "of 9600", 1.0, 0),
        "fb_cmd": _Shown("Feedback", "of 9600", 1.0, 0),
        "thrust": _Shown("Commanded thrust", "of 9600", 1.0, 0),
    }
)
_TOLERANCE_UNITS: Final = {"z_ref": "m", "zd_ref": "m/s", "zdd_ref": "m/s²", "z_sum_err": "of its largest"}
_BEYOND: Final = f"beyond the effect of {1000 * TIME_TOLERANCE_S:g} ms of time uncertainty"
_TO_THE_BIT: Final = "compared bit for bit"
_COUNTED: Final = f"only differences beyond the effect of {1000 * TIME_TOLERANCE_S:g} ms of time uncertainty count"
_DOWN: Final = "z and its speed and acceleration point down: 3 m up is z = −3 m."

FIGURES: Final[Mapping[str, tuple[str, tuple[str, ...]]]] = MappingProxyType(
    {"reference": ("Reference and integrator", SIMULATED), "commands": ("Commands", COMMANDS)}
)
"""The figures: title, and the signals one below another."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalResult:
    """Result of one signal: the largest difference between recording and replica in `difference_unit`, the tolerance,
    the number of samples that differ by more, and the time of the first of these, s."""

    name: str
    title: str
    largest_difference: float
    difference_unit: str
    tolerance: float
    allowance: str
    verdict: Verdict
    different: int
    first_different_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Everything that a page shows of one check. `better_gains` are other gains from which more of the commands
    follow."""

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

    def as_json(self) -> dict[str, object]:
        return asdict(self)


def examine_content(content: bytes, *, name: str, companion: bytes | None, given: Mapping[str, float] | None) -> Result:
    """Check a recording that is in memory, for a process of its own. Raises InputError as `check_recording` does."""
    beside = None if companion is None else BytesIO(companion)
    return result_of(check_recording(BytesIO(content), name=name, companion=beside, given=given))


def result_of(checked: LogCheck | TraceCheck) -> Result:
    return _result_of_log(checked) if isinstance(checked, LogCheck) else _result_of_trace(checked)


def _result_of_trace(checked: TraceCheck) -> Result:
    trace, replay = checked.trace, checked.replay
    recorded = dict(zip(OUTPUTS, trace.outputs.T, strict=True))
    replica = dict(zip(OUTPUTS, checked.computed.T, strict=True))
    differs = {name: recorded[name] != replica[name] for name in OUTPUTS}
    time_s = np.arange(replay.rows) / RATE_HZ
    overlay = Overlay(time_s, recorded, replica, differs)
    constant = {name: np.unique(trace.inputs[:, INPUTS.index(name)]) for name in GAINS}
    is_constant = all(len(values) == 1 for values in constant.values())
    return Result(
        kind="trace",
        passed=replay.exact,
        sentence=_trace_sentence(checked, differs),
        rows=replay.rows,
        gains={name: float(values[0]) for name, values in constant.items()} if is_constant else None,
        gains_from="of the recording" if is_constant else "not constant",
        better_gains=None,
        notes=(_DOWN,),
        signals=tuple(
            _signal(name, float(replay.largest_difference[name]), "counts", 0.0, _TO_THE_BIT, overlay)
            for name in OUTPUTS
        ),
        curves=_curves((overlay,)),
    )


def _result_of_log(checked: LogCheck) -> Result:
    commands, simulation = checked.commands, checked.simulation
    *simulated, drawn = checked.overlays
    apart = {name: float(np.abs(drawn.recorded[name] - drawn.replica[name]).max(initial=0)) for name in COMMANDS}
    signals = [
        _signal(name, difference, "counts", 0.0, f"{_TO_THE_BIT}; fields may be one step of 1/512 s apart", drawn)
        for name, difference in apart.items()
    ]
    if simulation is not None:
        signals[:0] = [
            _signal(name, difference, _TOLERANCE_UNITS[name], TOLERANCES[name], _COUNTED, simulated[0])
            for name, difference in simulation.largest_difference.items()
        ]
    return Result(
        kind="log",
        passed=checked.passed,
        sentence=_log_sentence(checked),
        rows=commands.rows,
        gains=dict(checked.gains),
        gains_from=checked.gains_from,
        better_gains=checked.better_gains,
        notes=(*_notes(checked), _DOWN),
        signals=tuple(signals),
        curves=_curves(checked.overlays),
    )


def _signal(
    name: str, difference: float, unit: str, tolerance: float, allowance: str, overlay: Overlay
) -> SignalResult:
    wrong = np.flatnonzero(overlay.differs[name])
    verdict: Verdict = "differs" if wrong.size else "exact" if difference == 0.0 else "agrees"
    return SignalResult(
        name=name,
        title=_SHOWN[name].title,
        largest_difference=difference,
        difference_unit=unit,
        tolerance=tolerance,
        allowance=allowance,
        verdict=verdict,
        different=int(wrong.size),
        first_different_s=round(float(overlay.time_s[wrong[0]]), 6) if wrong.size else None,
    )


def _trace_sentence(checked: TraceCheck, differs: Mapping[str, NDArray[np.bool_]]) -> str:
    replay = checked.replay
    if replay.first_different_row is None:
        return f"The replica agrees: all {_grouped(replay.rows)} steps are exact in all {len(OUTPUTS)} signals."
    row = replay.first_different_row
    names = ", ".join(name for name in OUTPUTS if differs[name][row])
    steps = int(np.logical_or.reduce(list(differs.values())).sum())
    return (
        f"The replica differs: {_grouped(steps)} of {_grouped(replay.rows)} steps are not exact, the first at "
        f"{row / RATE_HZ:.3f} s in {names}."
    )


def _log_sentence(checked: LogCheck) -> str:
    commands, simulation = checked.commands, checked.simulation
    if not commands.rows:
        return "Nothing could be compared: the loop was not in control in this log."
    if not commands.passed:
        return (
            f"The replica differs: {_grouped(commands.different)} of {_grouped(commands.rows)} commands are not "
            f"reproduced, the first at {commands.first_different_s:.3f} s."
        )
    if simulation is not None and not simulation.passed:
        name, value = max(simulation.largest_difference.items(), key=lambda pair: pair[1] / TOLERANCES[pair[0]])
        return (
            f"The replica differs: {name} is {value:.3g} {_TOLERANCE_UNITS[name]} {_BEYOND}; {TOLERANCES[name]:g} is "
            "allowed."
        )
    apart = sum(commands.stale.values())
    more = "" if not apart else f", the other {_grouped(apart)} with fields one step of 1/512 s apart"
    exact = f"{_grouped(commands.exact)} of {_grouped(commands.rows)}"
    return f"The replica agrees: {exact} commands are bit-exact{more}."


def _notes(checked: LogCheck) -> Iterable[str]:
    if checked.better_gains is not None:
        yield f"More commands match with {format_gains(checked.better_gains)}: were other gains flown?"
    yield from _notes_on(checked.commands)
    if checked.simulation is None:
        yield "Reference and integrator were not simulated: no command in the log, or another command within 2 s."
    else:
        yield (
            f"Reference and integrator were simulated again from the command at {checked.simulation.command_s:.3f} s "
            f"for {checked.simulation.duration_s:.1f} s."
        )


def _notes_on(commands: CommandCheck) -> Iterable[str]:
    if commands.tilted:
        tilt = f"{commands.largest_tilt_deg:.1f}°"
        yield f"Commands reproduced under a tilt of up to {tilt}: {_grouped(commands.tilted)}."
    for fields, count in commands.stale.items():
        if count:
            yield f"Commands reproduced only with the {fields} one step apart: {_grouped(count)}."


def _curves(overlays: Iterable[Overlay]) -> dict[str, Overlaid]:
    return {name: _curve(name, overlay) for overlay in overlays for name in overlay.recorded if len(overlay.time_s)}


def _curve(name: str, overlay: Overlay) -> Overlaid:
    """Curves of a signal, thinned to common times such that both keep their shape and extremes."""
    shown = _SHOWN[name]
    known = np.flatnonzero(np.isfinite(overlay.replica[name]))
    recorded, replica = (_scaled(values[known], shown) for values in (overlay.recorded[name], overlay.replica[name]))
    time_s = overlay.time_s[known]
    kept = sorted({*_kept(recorded), *_kept(replica)})
    wrong = np.flatnonzero(overlay.differs[name][known])
    marked = wrong if len(wrong) <= MARKS else wrong[np.linspace(0, len(wrong) - 1, MARKS).astype(np.int64)]
    return Overlaid(
        label=f"{name} ({shown.unit})",
        digits=shown.digits,
        time_s=_rounded(time_s[kept]),
        recorded=_rounded(recorded[kept]),
        replica=_rounded(replica[kept]),
        differing_s=_rounded(time_s[marked]),
        differing=_rounded(recorded[marked]),
    )


def _scaled(values: Values, shown: _Shown) -> Samples:
    return np.asarray(values, dtype=np.float64) * shown.scale


def _rounded(values: Samples) -> tuple[float, ...]:
    return tuple(round(float(each), 6) for each in values)


def _kept(values: Samples) -> list[int]:
    return [int(place) for place in thinned(np.arange(len(values), dtype=np.float64), values, CURVE_POINTS)[0]]


def _grouped(count: int) -> str:
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
