"""Comparison of a recorded vertical loop with the replica, for the command line and the web page.

The recording is the log of a flight, or a trace with a row for every step.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.loop_log import (
    GAINS,
    CommandCheck,
    Overlay,
    SimulationCheck,
    compare_commands,
    compare_simulation,
    infer_gains,
)
from app.core.control.paparazzi import LoopTrace, Replay, compared, replayed
from app.core.errors import InputError, Problem
from app.logs.loop_trace import may_be_loop_trace, read_loop_trace_stream
from app.logs.paparazzi import is_paparazzi, read_loop_log

_HEAD_BYTES: Final = 4096
_MAX_DIGITS: Final = 9


@dataclass(frozen=True, slots=True)
class LogCheck:
    """Result of checking a log.

    Its gains and their source, the gains inferred from its commands, and both parts of the comparison with their
    overlays.
    """

    gains: Mapping[str, float]
    gains_from: str
    inferred: Mapping[str, float] | None
    commands: CommandCheck
    simulation: SimulationCheck | None
    overlays: tuple[Overlay, ...]

    @property
    def passed(self) -> bool:
        return self.commands.passed and (self.simulation is None or self.simulation.passed)

    @property
    def better_gains(self) -> Mapping[str, float] | None:
        """The inferred gains, if they differ: more of the commands follow from these."""
        return None if self.inferred is None or dict(self.inferred) == dict(self.gains) else self.inferred


@dataclass(frozen=True, slots=True)
class TraceCheck:
    """Result of checking a trace: the trace, the replica's outputs for it, shape (n, 7), and their differences."""

    trace: LoopTrace
    computed: NDArray[np.int64]
    replay: Replay

    @property
    def passed(self) -> bool:
        return self.replay.exact


def check_recording(
    stream: BinaryIO, *, name: str, companion: BinaryIO | None = None, given: Mapping[str, float] | None = None
) -> LogCheck | TraceCheck:
    """Check a log or a trace, whichever the content is. Raises InputError that names what cannot be read."""
    stream.seek(0)
    head = stream.read(_HEAD_BYTES)
    if is_paparazzi(head):
        return check_log(stream, name=name, companion=companion, given=given)
    if may_be_loop_trace(head):
        return check_trace(read_loop_trace_stream(stream, name=name))
    reason = "is empty" if not head else "is neither a Paparazzi .data file nor a trace"
    raise InputError(
        f"{name} is not a recording of the vertical loop.",
        hint="Give the .data file of Paparazzi's ground log with VERT_LOOP messages, together with its .log, or "
        "a trace of the loop, .csv or .csv.gz, with one row per step.",
        problems=(Problem("file", reason),),
    )


def check_trace(trace: LoopTrace) -> TraceCheck:
    """Compare every output of every row."""
    computed = replayed(trace)
    return TraceCheck(trace, computed, compared(trace, computed))


def check_log(
    stream: BinaryIO, *, name: str, companion: BinaryIO | None = None, given: Mapping[str, float] | None = None
) -> LogCheck:
    """Check a .data file of Paparazzi.

    The gains are those given, else the log's own, else those inferred from its commands. Raises InputError when it has
    no VERT_LOOP, or its gains cannot be determined.
    """
    log, logged = read_loop_log(stream, companion)
    inferred = infer_gains(log)
    for gains, source in ((given, "given"), (logged, "of the log"), (inferred, "computed from the commands")):
        if gains is not None:
            commands, drawn = compare_commands(log, gains)
            simulated = compare_simulation(log)
            if simulated is None:
                return LogCheck(gains, source, inferred, commands, None, (drawn,))
            return LogCheck(gains, source, inferred, commands, simulated[0], (simulated[1], drawn))
    raise InputError(
        f"{name} does not contain the gains flown, and its motion is too small to compute them.",
        problems=(Problem("gains", "are needed"),),
        hint="Add the .log file that was written with it, or give the gains (on the command line: --gains KP,KI,KD).",
    )


def parse_gains(given: str, *, field: str = "gains") -> dict[str, float]:
    """Parse gains from `KP,KI,KD`. Raises InputError that names `field`."""
    parts = given.split(",")
    if len(parts) != len(GAINS) or not all(_is_whole(part.strip()) for part in parts):
        raise InputError(
            f"{given[:60]!r} is not a gain set.",
            problems=(Problem(field, "must be three whole numbers, KP,KI,KD"),),
            hint="For example 283,13,82.",
        )
    return {name: float(part) for name, part in zip(GAINS, parts, strict=True)}


def _is_whole(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) <= _MAX_DIGITS
