"""What every log reader needs: a log's bytes, memory-mapped where possible, and the names of each autopilot's gains."""

import io
import mmap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.ardupilot_parameters import GAINS as ARDUPILOT_GAINS
from app.core.control.ardupilot_parameters import NEWER_NAMES
from app.core.control.loop_log import GAINS
from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Samples

MAX_BYTES: Final = 512 * 2**20

Table = Mapping[str, NDArray[np.generic]]
"""Columns of one message type or topic, each of shape (n,)."""

Contents = bytes | mmap.mmap
"""Both support slicing, searching and indexing."""


def contents(stream: BinaryIO) -> Contents:
    """All bytes of a stream, mapped if it has a file. Raises TrajectoryError if it is larger than 512 MiB."""
    size = stream.seek(0, io.SEEK_END)
    stream.seek(0)
    if size > MAX_BYTES:
        raise TrajectoryError(
            f"The log is too large: {size / 2**20:.0f} MiB.",
            hint=f"Trim it to the flight: at most {MAX_BYTES / 2**20:g} MiB can be read.",
            problems=(Problem("file", f"is larger than {MAX_BYTES / 2**20:g} MiB"),),
        )
    if not size:
        return b""
    try:
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError):  # not a file, or one that cannot be mapped
        return stream.read()


def refused(reason: str, hint: str) -> TrajectoryError:
    """The error for a file that cannot be read as the expected kind of log."""
    return TrajectoryError("This file cannot be read as a flight.", hint=hint, problems=(Problem("file", reason),))


def numbers(column: NDArray[np.generic]) -> Samples:
    """The column as floats; NaN if a damaged description made it a text."""
    if column.ndim != 1 or column.dtype.kind not in "iuf":
        return np.full(len(column), np.nan)
    with np.errstate(invalid="ignore"):  # a damaged number may be a signalling NaN
        return column.astype(np.float64)


def rows_of(table: Table, clock: str, *names: str) -> Iterator[tuple[float, ...]]:
    """Time, in s, and columns of a table, row by row; none if a column is missing. `clock` is the one in µs."""
    if {clock, *names} <= table.keys():
        columns = [numbers(table[clock]) / 1e6, *(numbers(table[name]) for name in names)]
        yield from zip(*(column.tolist() for column in columns), strict=True)


PAPARAZZI: Final[Mapping[str, str]] = MappingProxyType({"gui_v_kp": "kp", "gui_v_ki": "ki", "gui_v_kd": "kd"})
"""Its MAVLink parameters, and the names of these gains in the takeoff experiment."""


@dataclass(frozen=True, slots=True)
class LoggedGain:
    """A gain of an experiment by its name in the log, with the `factor` from the gain to the value in the log."""

    name: str
    gain: str
    factor: float = 1.0

    def value(self, logged: float) -> float:
        """The gain for a value in the log, to the seven digits of single precision."""
        return logged if self.factor == 1.0 else float(f"{logged / self.factor:.7g}")


GainSets = Sequence[Sequence[LoggedGain]]


def _own_names(*names: str) -> Sequence[LoggedGain]:
    return tuple(LoggedGain(name, name) for name in names)


PAPARAZZI_SETS: Final[GainSets] = (_own_names(*GAINS),)

ARDUPILOT_SETS: Final[GainSets] = (
    _own_names(*ARDUPILOT_GAINS),
    tuple(
        LoggedGain(newer, older, 1.0 / factor)
        for newer, (older, factor) in NEWER_NAMES.items()
        if older in ARDUPILOT_GAINS
    ),
)
"""Until 4.6, and from 4.7 on."""

PX4_SETS: Final[GainSets] = (_own_names("MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC"),)


def names_in(sets: GainSets) -> frozenset[str]:
    """All names in these sets, as in the log."""
    return frozenset(gain.name for gains in sets for gain in gains)
