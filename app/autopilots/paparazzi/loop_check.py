"""Paparazzi's entry in the registry: its log of a flight, `.data` with VERT_LOOP, and traces with a row per step: CSV,
optionally gzipped, integers only.
"""

import csv
import gzip
import re
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.loop_check import (
    LoopCheck,
    Result,
    Signal,
    TraceReplay,
    Upload,
    curves,
    grouped,
    result_of_trace,
    signal_result,
)
from app.autopilots.paparazzi.log import HINT, PaparazziRecording, read_paparazzi
from app.autopilots.paparazzi.replica.loop_log import COMMANDS, GAINS, CommandCheck, FlownGains, compare_commands
from app.autopilots.paparazzi.replica.simulation import (
    SIMULATED,
    TIME_TOLERANCE_S,
    TOLERANCES,
    UNITS,
    SimulationCheck,
    compare_simulation,
)
from app.core.control.vertical_guidance import (
    INPUTS,
    INT32_MAX,
    INT32_MIN,
    MODES,
    OUTPUTS,
    RATE_HZ,
    LoopTrace,
    replayed,
)
from app.core.errors import InputError, Problem
from app.core.formatting import format_gains
from app.core.records.trajectory import Overlay
from app.logs.base import refused
from app.logs.formats import Format
from app.logs.trace_table import GZIP, TraceChecks, is_zipped, read_rows, text_of

COLUMNS: Final = ("step", *INPUTS[:7], "zdd", *INPUTS[7:], *OUTPUTS)
_INTEGER: Final = re.compile(r"[+-]?[0-9]{1,19}")
_TRACE_HINT: Final = f"A trace has the columns {','.join(COLUMNS)}, one row per 1/512 s, as 32-bit integers."

_in_counts: Final = partial(Signal, difference_unit="counts")
_SIGNALS: Final[Mapping[str, Signal]] = MappingProxyType(
    {
        "z_ref": _in_counts("Reference altitude", "m", 3, scale=UNITS["z_ref"]),
        "zd_ref": _in_counts("Reference speed", "m/s", 3, scale=UNITS["zd_ref"]),
        "zdd_ref": _in_counts("Reference acceleration", "m/s²", 2, scale=UNITS["zdd_ref"]),
        "z_sum_err": _in_counts("Summed error", "m·s", 3, scale=UNITS["z_ref"] / RATE_HZ),
        "ff_cmd": _in_counts("Feed-forward", "of 9600", 0),
        "fb_cmd": _in_counts("Feedback", "of 9600", 0),
        "thrust": _in_counts("Commanded thrust", "of 9600", 0),
    }
)
TOLERANCE_UNITS: Final = {"z_ref": "m", "zd_ref": "m/s", "zdd_ref": "m/s²", "z_sum_err": "of its largest"}
_BEYOND: Final = f"beyond the effect of {1000 * TIME_TOLERANCE_S:g} ms of time uncertainty"
_STEP_APART: Final = "compared bit for bit; fields may be one step of 1/512 s apart"
_DOWN: Final = "z and its speed and acceleration point down: 3 m up is z = −3 m."


@dataclass(frozen=True, slots=True)
class LogCheck:
    """Result of checking a log.

    Its gains, their source and notes on them; other gains from which more of the commands follow; both parts of the
    comparison with their overlays.
    """

    flown: Sequence[FlownGains]
    gains_from: str
    better_gains: Mapping[str, float] | None
    gain_notes: Sequence[str]
    commands: CommandCheck
    simulation: SimulationCheck | None
    overlays: tuple[Overlay, ...]

    @property
    def passed(self) -> bool:
        return self.commands.passed and (self.simulation is None or self.simulation.passed)

    @property
    def gains(self) -> Mapping[str, float] | None:
        """None if they change."""
        return self.flown[0].gains if len(self.flown) == 1 else None

    @property
    def gains_text(self) -> str:
        """`kp 283, ki 13, kd 82; after 94.9 s kp 300, ki 13, kd 82 (of the log)`."""
        texts = [format_gains(each.gains) if each.gains else "unknown" for each in self.flown]
        changes = [f"after {each.after_s:.1f} s {text}" for each, text in zip(self.flown, texts, strict=True)]
        return f"{'; '.join([*texts[:1], *changes[1:]])} ({self.gains_from})"


def check_log(recording: PaparazziRecording, *, name: str, given: Mapping[str, float] | None = None) -> LogCheck:
    """Check a .data file of Paparazzi.

    The gains are those given, else those that its commands follow from. Raises InputError when it has no VERT_LOOP, or
    its gains cannot be determined.
    """
    loop = recording.loop
    if loop is None:
        raise refused("contains no VERT_LOOP, the loop's inputs and commands", HINT)
    flown = recording.flown if given is None else [FlownGains(0.0, given)]
    if not any(each.gains for each in flown):
        raise InputError(
            f"{name} does not contain the gains flown, and its motion is too small to compute them.",
            problems=(Problem("gains", "are needed"),),
            hint="Add the .log file written with it, or give the gains (on the command line: --gains KP,KI,KD).",
        )
    source = "given" if given is not None else "of the log" if recording.are_logged else "computed from the commands"
    commands, drawn = compare_commands(loop, flown)
    simulated = compare_simulation(loop)
    simulation, overlays = (None, (drawn,)) if simulated is None else (simulated[0], (simulated[1], drawn))
    computed = recording.flown
    better = computed[0].gains if len(computed) == 1 and given not in (None, computed[0].gains) else None
    return LogCheck(flown, source, better, recording.notes, commands, simulation, overlays)


def parse_gains(given: str, *, field: str = "gains") -> dict[str, float]:
    """Parse gains from `KP,KI,KD`. Raises InputError that names `field`."""
    parts = given.split(",")
    if len(parts) != len(GAINS) or not all(re.fullmatch("[0-9]{1,9}", part.strip()) for part in parts):
        raise InputError(
            f"{given[:60]!r} is not a gain set.",
            problems=(Problem(field, "must be three whole numbers, KP,KI,KD"),),
            hint="For example 283,13,82.",
        )
    return {name: float(part) for name, part in zip(GAINS, parts, strict=True)}


def read_loop_trace(path: Path) -> LoopTrace:
    """Read `path` (.csv or .csv.gz). Raises InputError naming the line and the column of the first error."""
    try:
        with path.open("rb") as raw:
            return _read_trace(TraceChecks(path.name, _TRACE_HINT), raw, zipped=path.suffix == ".gz")
    except OSError as error:
        raise InputError(
            f"{path} could not be read: {error.strerror or error}.", hint="Use a readable trace file, .csv or .csv.gz."
        ) from error


def may_be_loop_trace(head: bytes) -> bool:
    """Whether a file with this head can be a trace: gzipped, or text whose first line names a column of a trace."""
    first = head.partition(b"\n")[0]
    return head.startswith(GZIP) or bool({b"mode", b"z_ref", b"r33"} & {column.strip() for column in first.split(b",")})


def _read_trace(checks: TraceChecks, raw: BinaryIO, *, zipped: bool) -> LoopTrace:
    with text_of(checks, raw, zipped=zipped) as text:
        reader = csv.reader(text)
        header = next(reader, [])
        if problems := tuple(Problem(f"line 1, {each}", "column is missing") for each in COLUMNS if each not in header):
            raise InputError(f"{checks.name} is not a trace of the vertical loop.", hint=_TRACE_HINT, problems=problems)
        if len(header) != len(COLUMNS):
            extra = next((column for column in header if column not in COLUMNS), header[-1])
            raise checks.malformed(f"line 1, {extra}", "column is unknown or appears twice")
        values = array("q", read_rows(checks, reader, header, _trace_value, first_line=2))
    rows = np.array(values, dtype=np.int64).reshape(-1, len(header))
    return LoopTrace(*(rows[:, [header.index(column) for column in columns]] for columns in (INPUTS, OUTPUTS)))


def _trace_value(column: str, text: str) -> int:
    if column == "mode":
        if text not in MODES:
            raise ValueError(f"must be one of {', '.join(MODES)}, got {text!r}")
        return MODES[text]
    if not _INTEGER.fullmatch(text):
        raise ValueError(f"must be a whole number, got {text[:40]!r}")
    value = int(text)
    low, high = (0, 1) if column == "in_flight" else (INT32_MIN, INT32_MAX)
    if not low <= value <= high:
        raise ValueError(f"must be between {low} and {high}, got {value}")
    return value


def _examine_log(upload: Upload) -> Result:
    recording = read_paparazzi(upload.stream, upload.companion)
    checked = check_log(recording, name=upload.name, given=upload.given)
    commands, simulation = checked.commands, checked.simulation
    *simulated, drawn = checked.overlays
    apart = {name: float(np.abs(drawn.recorded[name] - drawn.replica[name]).max(initial=0)) for name in COMMANDS}
    signals = [
        signal_result(name, replace(_SIGNALS[name], allowance=_STEP_APART), drawn, largest_difference=difference)
        for name, difference in apart.items()
    ]
    if simulation is not None:
        counted = f"only differences {_BEYOND} count"
        judged = {
            name: replace(_SIGNALS[name], tolerance=allowed, allowance=counted, difference_unit=TOLERANCE_UNITS[name])
            for name, allowed in TOLERANCES.items()
        }
        signals[:0] = [
            signal_result(name, judged[name], simulated[0], largest_difference=difference)
            for name, difference in simulation.largest_difference.items()
        ]
    return Result(
        kind="log",
        passed=checked.passed,
        sentence=_log_sentence(checked),
        rows=commands.rows,
        gains=checked.gains,
        gains_from=checked.gains_from,
        better_gains=checked.better_gains,
        notes=(*_notes(checked), _DOWN),
        signals=tuple(signals),
        curves=curves(_SIGNALS, checked.overlays),
    )


def _examine_trace(upload: Upload) -> Result:
    checks = TraceChecks(upload.name, _TRACE_HINT)
    try:
        trace = _read_trace(checks, upload.stream, zipped=is_zipped(upload.stream))
    except gzip.BadGzipFile as error:
        raise checks.damaged(error) from error
    constant = {name: np.unique(trace.inputs[:, INPUTS.index(name)]) for name in GAINS}
    is_constant = all(len(values) == 1 for values in constant.values())
    replay = TraceReplay(
        time_s=np.arange(len(trace)) / RATE_HZ,
        recorded=dict(zip(OUTPUTS, trace.outputs.T, strict=True)),
        replica=dict(zip(OUTPUTS, replayed(trace).T, strict=True)),
        gains={name: float(values[0]) for name, values in constant.items()} if is_constant else None,
        notes=(_DOWN,),
    )
    return result_of_trace(_SIGNALS, replay)


def _log_sentence(checked: LogCheck) -> str:
    commands, simulation = checked.commands, checked.simulation
    if not commands.rows:
        return "Nothing could be compared: the loop was not in control in this log."
    if not commands.passed:
        verb = "is" if commands.different == 1 else "are"
        return (
            f"The replica differs: {grouped(commands.different)} of {grouped(commands.rows)} commands {verb} not "
            f"reproduced, the first at {commands.first_different_s:.3f} s."
        )
    if simulation is not None and not simulation.passed:
        name, value = max(simulation.largest_difference.items(), key=lambda pair: pair[1] / TOLERANCES[pair[0]])
        return (
            f"The replica differs: {name} is {value:.3g} {TOLERANCE_UNITS[name]} {_BEYOND}; {TOLERANCES[name]:g} is "
            "allowed."
        )
    apart = sum(commands.stale.values())
    more = "" if not apart else f", the other {grouped(apart)} with fields one step of 1/512 s apart"
    exact = f"{grouped(commands.exact)} of {grouped(commands.rows)}"
    return f"The replica agrees: {exact} commands are bit-exact{more}."


def _notes(checked: LogCheck) -> Iterable[str]:
    if checked.gains is None:
        yield f"The gains changed: {checked.gains_text}."
    yield from (f"{note[0].upper()}{note[1:]}." for note in checked.gain_notes)
    if checked.better_gains is not None:
        yield f"More commands match with {format_gains(checked.better_gains)}: were other gains flown?"
    commands = checked.commands
    if commands.tilted:
        tilt = f"{commands.largest_tilt_deg:.1f}°"
        yield f"Commands reproduced under a tilt of up to {tilt}: {grouped(commands.tilted)}."
    if commands.rounded:
        yield f"Commands reproduced with an r33 rounded to one count above level: {grouped(commands.rounded)}."
    for fields, count in commands.stale.items():
        if count:
            yield f"Commands reproduced only with the {fields} one step apart: {grouped(count)}."
    if checked.simulation is None:
        yield "Reference and integrator were not simulated: no command in the log, or another command within 2 s."
    else:
        yield (
            f"Reference and integrator were simulated again from the command at {checked.simulation.command_s:.3f} s "
            f"for {checked.simulation.duration_s:.1f} s."
        )


CHECK: Final = LoopCheck(
    recordings="the .data file of Paparazzi's ground log with VERT_LOOP messages, together with its .log, or a trace "
    "with one row per step of 1/512 s",
    signals=_SIGNALS,
    figures=MappingProxyType(
        {"reference": ("Reference and integrator", SIMULATED), "commands": ("Commands", COMMANDS)}
    ),
    note=_DOWN,
    log=Format.GROUND_LOG,
    is_trace=may_be_loop_trace,
    examine_log=_examine_log,
    examine_trace=_examine_trace,
)
