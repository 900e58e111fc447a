"""Paparazzi's loop beside its replica: its log of a flight, `.data` with VERT_LOOP, and traces: CSV of integers, one
row per step."""

import csv
import re
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.paparazzi.log import PaparazziRecording
from app.autopilots.paparazzi.replica.loop_log import COMMANDS, GAINS, CommandCheck, FlownGains, compare_commands
from app.autopilots.paparazzi.replica.simulation import (
    SIMULATED,
    TIME_TOLERANCE_S,
    TOLERANCES,
    UNITS,
    SimulationCheck,
    compare_simulation,
)
from app.autopilots.recording import Recording, refusal
from app.autopilots.replica_check import (
    LoopReplica,
    Replay,
    ReplicaCheck,
    Signal,
    SignalResult,
    check_replay,
    grouped,
    signal_result,
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
from app.core.formatting import capitalised, format_gains
from app.core.policy import Gains
from app.core.records.trajectory import Overlay
from app.logs.trace_table import TraceChecks, read_rows, text_of, unzipped

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
_TOLERANCE_UNITS: Final = {"z_ref": "m", "zd_ref": "m/s", "zdd_ref": "m/s²", "z_sum_err": "of its largest"}
_BEYOND: Final = f"beyond the effect of {1000 * TIME_TOLERANCE_S:g} ms of time uncertainty"
_DOWN: Final = "z and its speed and acceleration point down: 3 m up is z = −3 m."


def read_loop_trace(path: Path) -> LoopTrace:
    """Read `path` (.csv or .csv.gz). Raises InputError naming the line and the column of the first error."""
    try:
        with path.open("rb") as raw:
            return _read_trace(raw, path.name)
    except OSError as error:
        raise InputError(
            f"{path} could not be read: {error.strerror or error}.", hint="Use a readable trace file, .csv or .csv.gz."
        ) from error


def _is_trace(head: bytes) -> bool:
    """Whether the first line, plain or gzipped, names a column of a trace."""
    columns = {column.strip() for column in unzipped(head).partition(b"\n")[0].split(b",")}
    return bool({b"mode", b"z_ref", b"r33"} & columns)


def _read_trace(stream: BinaryIO, name: str) -> LoopTrace:
    checks = TraceChecks(name, _TRACE_HINT)
    with text_of(checks, stream) as text:
        reader = csv.reader(text)
        header = next(reader, [])
        if problems := tuple(Problem(f"line 1, {each}", "column is missing") for each in COLUMNS if each not in header):
            raise InputError(f"{name} is not a trace of the vertical loop.", hint=_TRACE_HINT, problems=problems)
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


def _check_log(recording: Recording, name: str, given: str) -> ReplicaCheck:
    """Compare the commands of a .data file and, from the command on, the reference and the integrator.

    The gains are those given, else those that the commands follow from. Raises InputError when the file has no
    VERT_LOOP, or the gains cannot be determined.
    """
    if not isinstance(recording, PaparazziRecording) or recording.loop is None:
        refused = refusal(
            f"{name} cannot be compared with the replica.",
            "Give the .data file of Paparazzi's ground log, with VERT_LOOP in it.",
            error=InputError,
        )
        raise refused("file", "contains no VERT_LOOP, the loop's inputs and commands")
    computed = recording.flown
    flown = [FlownGains(0.0, _parsed(given))] if given else computed
    if not any(each.gains for each in flown):
        raise InputError(
            f"{name} does not contain the gains flown, and its motion is too small to compute them.",
            problems=(Problem("gains", "are needed"),),
            hint="Add the .log file written with it, or give the gains (on the command line: --gains KP,KI,KD).",
        )
    source = "given" if given else "of the log" if recording.are_logged else "computed from the commands"
    better = computed[0].gains if len(computed) == 1 and computed[0].gains != flown[0].gains else None
    commands, simulation = compare_commands(recording.loop, flown), compare_simulation(recording.loop)
    notes = [f"{capitalised(note)}." for note in recording.notes]
    if len(flown) > 1:
        texts = [format_gains(each.gains) if each.gains else "unknown" for each in flown]
        changes = [f"after {each.after_s:.1f} s {text}" for each, text in zip(flown, texts, strict=True)]
        notes.insert(0, f"The gains changed: {'; '.join([*texts[:1], *changes[1:]])} ({source}).")
    if better is not None:
        notes.append(f"More commands match with {format_gains(better)}: were other gains flown?")
    return ReplicaCheck(
        kind="log",
        passed=commands.passed and (simulation is None or simulation.passed),
        sentence=_sentence(commands, simulation),
        rows=commands.rows,
        gains=flown[0].gains if len(flown) == 1 else None,
        gains_from=source,
        better_gains=better,
        notes=(*notes, *_notes(commands, simulation), _DOWN),
        signals=[*([] if simulation is None else _simulated(simulation)), *_commanded(commands.overlay)],
        overlays=[each.overlay for each in (simulation, commands) if each is not None],
    )


def _parsed(given: str) -> Gains:
    """The gains of `KP,KI,KD`. Raises InputError."""
    parts = given.split(",")
    if len(parts) != len(GAINS) or not all(re.fullmatch("[0-9]{1,9}", part.strip()) for part in parts):
        raise InputError(
            f"{given[:60]!r} is not a gain set.",
            problems=(Problem("gains", "must be three whole numbers, KP,KI,KD"),),
            hint="For example 283,13,82.",
        )
    return {name: float(part) for name, part in zip(GAINS, parts, strict=True)}


def _simulated(simulation: SimulationCheck) -> Iterable[SignalResult]:
    for name, difference in simulation.largest_difference.items():
        signal = replace(
            _SIGNALS[name],
            tolerance=TOLERANCES[name],
            allowance=f"only differences {_BEYOND} count",
            difference_unit=_TOLERANCE_UNITS[name],
        )
        yield signal_result(name, signal, simulation.overlay, largest_difference=difference)


def _commanded(drawn: Overlay) -> Iterable[SignalResult]:
    for name in COMMANDS:
        largest = float(np.abs(drawn.recorded[name] - drawn.replica[name]).max(initial=0))
        yield signal_result(
            name,
            replace(_SIGNALS[name], allowance="compared bit for bit; fields may be one step of 1/512 s apart"),
            drawn,
            largest_difference=largest,
        )


def _check_trace(stream: BinaryIO, name: str) -> ReplicaCheck:
    trace = _read_trace(stream, name)
    constant = {name: np.unique(trace.inputs[:, INPUTS.index(name)]) for name in GAINS}
    is_constant = all(len(values) == 1 for values in constant.values())
    replay = Replay(
        time_s=np.arange(len(trace)) / RATE_HZ,
        recorded=dict(zip(OUTPUTS, trace.outputs.T, strict=True)),
        replica=dict(zip(OUTPUTS, replayed(trace).T, strict=True)),
        gains={name: float(values[0]) for name, values in constant.items()} if is_constant else None,
        notes=(_DOWN,),
    )
    return check_replay(_SIGNALS, replay, kind="trace")


def _sentence(commands: CommandCheck, simulation: SimulationCheck | None) -> str:
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
            f"The replica differs: {name} is {value:.3g} {_TOLERANCE_UNITS[name]} {_BEYOND}; {TOLERANCES[name]:g} is "
            "allowed."
        )
    apart = sum(commands.stale.values())
    more = "" if not apart else f", the other {grouped(apart)} with fields one step of 1/512 s apart"
    exact = f"{grouped(commands.exact)} of {grouped(commands.rows)}"
    return f"The replica agrees: {exact} commands are bit-exact{more}."


def _notes(commands: CommandCheck, simulation: SimulationCheck | None) -> Iterable[str]:
    if commands.tilted:
        tilt = f"{commands.largest_tilt_deg:.1f}°"
        yield f"Commands reproduced under a tilt of up to {tilt}: {grouped(commands.tilted)}."
    if commands.rounded:
        yield f"Commands reproduced with an r33 rounded to one count above level: {grouped(commands.rounded)}."
    for fields, count in commands.stale.items():
        if count:
            yield f"Commands reproduced only with the {fields} one step apart: {grouped(count)}."
    if simulation is None:
        yield "Reference and integrator were not simulated: no command in the log, or another command within 2 s."
    else:
        yield (
            f"Reference and integrator were simulated again from the command at {simulation.command_s:.3f} s "
            f"for {simulation.duration_s:.1f} s."
        )


REPLICA: Final = LoopReplica(
    signals=_SIGNALS,
    figures=(("Reference and integrator", SIMULATED), ("Commands", COMMANDS)),
    note=_DOWN,
    check_log=_check_log,
    is_trace=_is_trace,
    check_trace=_check_trace,
)
