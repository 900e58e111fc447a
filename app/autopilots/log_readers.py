"""All supported kinds of logs; a new one takes one line in `READERS`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import PurePath
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.logged_flight import TuningSegment, ardupilot_flight
from app.autopilots.copter_tlog import copter_steps
from app.autopilots.frames import frame_of
from app.autopilots.paparazzi.log import HINT as PAPARAZZI_HINT
from app.autopilots.paparazzi.log import read_paparazzi
from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.px4.log import read_px4
from app.autopilots.px4.logged_flight import px4_flight
from app.autopilots.recording import Recording
from app.autopilots.takeoffs import Takeoff, choose, find_takeoffs
from app.autopilots.tlog import read_tlog
from app.autopilots.tlog_vehicles import HINT as TLOG_HINT
from app.core.analysis.loop import AltitudeLoop, LoggedFlight
from app.core.analysis.segment import FinerSegment, Segment
from app.core.errors import InputError, Problem, TrajectoryError
from app.core.reasons import OTHER_FRAMES
from app.logs.base import refused
from app.logs.formats import NEVER_WRITTEN, Format, head_of, recognise
from app.logs.takeoff_csv import read_takeoff_csv
from app.logs.ulog import HINT as ULOG_HINT


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """One kind of log: its title, the function that decodes it, and the one that gives the flight in it that can be
    analysed, None if its takeoffs are. `altitude` are the messages that have it, and `hint` says which log to use where
    it has none."""

    title: str
    read: Callable[[BinaryIO, BinaryIO | None], Recording]
    flight: Callable[[Recording, str], LoggedFlight | None]
    altitude: str
    hint: str

    def takeoffs(self, recording: Recording) -> Sequence[Takeoff]:
        """Every takeoff, of all vehicles. Raises TrajectoryError if there is none, or no altitude."""
        if "altitude_m" not in recording.columns:
            raise refused(f"contains {self.altitude}", self.hint)
        return find_takeoffs(recording)

    def flown(self, recording: Recording, name: str) -> LoggedFlight | Sequence[Takeoff]:
        """The flight of a copter's log, or every takeoff of a Paparazzi log, to be analysed. Raises InputError that
        names what is missing or wrong."""
        flight = self.flight(recording, name)
        return self.takeoffs(recording) if flight is None else flight

    def vehicle(self, recording: Recording, name: str, system: int | None = None) -> Recording:
        """The recording of one vehicle in a log: with this system id, or the one with the most to learn. Raises
        TrajectoryError if none has the id."""
        vehicles = [replace(each, others=()) for each in (recording, *recording.others)]
        chosen = [each for each in vehicles if system in (None, each.system)]
        if not chosen:
            there = ", ".join(str(each.system) for each in vehicles)
            raise refused(f"has no vehicle {system}, only {there}", "Choose one of these.", field="vehicle")
        return chosen[0] if len(chosen) == 1 else max(chosen, key=lambda each: self._to_learn(each, name))

    def _to_learn(self, recording: Recording, name: str) -> tuple[bool, bool, float]:
        """Whether the vehicle's flight can be analysed, whether it may be a copter, and by how much it moves."""
        altitude = recording.columns.get("altitude_m")
        moves_m = 0.0 if altitude is None else float(np.ptp(np.nan_to_num(altitude.values)))
        try:
            flown = self.flown(recording, name)
        except InputError:
            return False, frame_of(recording) not in OTHER_FRAMES, moves_m
        if isinstance(flown, LoggedFlight):
            moves_m = float(sum(np.ptp(each.z_d_m) for each in flown.segments))
        return True, True, moves_m


def _alone(read: Callable[[BinaryIO], Recording]) -> Callable[[BinaryIO, BinaryIO | None], Recording]:
    """Adapt a reader of logs without a companion."""
    return lambda stream, _companion: read(stream)


_ARDUPILOT: Final = Reader(
    title="ArduPilot's on-board log",
    read=_alone(read_ardupilot),
    flight=ardupilot_flight,
    altitude="neither PSCD.PD nor CTUN.Alt, the altitude",
    hint="Use ArduPilot's .bin log of the flight, recorded with control tuning in LOG_BITMASK (PSCD, CTUN).",
)

READERS: Final[Mapping[Format, Reader]] = {
    Format.TLOG: Reader(
        title="MAVLink telemetry log",
        read=_alone(read_tlog),
        flight=copter_steps,
        altitude="neither LOCAL_POSITION_NED nor GLOBAL_POSITION_INT of the vehicle",
        hint=TLOG_HINT,
    ),
    Format.DATAFLASH: _ARDUPILOT,
    Format.DATAFLASH_TEXT: _ARDUPILOT,
    Format.ULOG: Reader(
        title="PX4's log",
        read=_alone(read_px4),
        flight=px4_flight,
        altitude="no vehicle_local_position.z, the altitude",
        hint=ULOG_HINT,
    ),
    Format.GROUND_LOG: Reader(
        title="Paparazzi's ground log",
        read=read_paparazzi,
        flight=lambda _recording, _name: None,
        altitude="neither VERT_LOOP nor ROTORCRAFT_FP",
        hint=PAPARAZZI_HINT,
    ),
}

LOOPS: Final[Mapping[str, type[AltitudeLoop]]] = MappingProxyType(
    {loop.texts.autopilot: loop for loop in (ArduPilotLoop, Px4Loop)}
)
"""Altitude loops of logged flights, by the autopilot in their texts."""

SEGMENTS: Final[Mapping[str, type[Segment]]] = MappingProxyType(
    {segment.__name__: segment for segment in (Segment, FinerSegment, TuningSegment)}
)
"""Kinds of segments of logged flights, by name."""

SUFFIXES: Final = (".csv", *READERS)


def reader_of(head: bytes) -> Reader | None:
    """The reader of a file with these first bytes; None if it is no log."""
    log = recognise(head)
    return None if log is None else READERS.get(log)


def read_takeoffs(stream: BinaryIO, *, name: str = "", companion: BinaryIO | None = None) -> Sequence[Takeoff]:
    """Read every takeoff in a log, or the single one in a CSV file.

    The kind of log is determined from the content; the file `name` is used only in error messages. `companion` is the
    .log file of a .data file. Raises TrajectoryError for anything that cannot be read.
    """
    head = head_of(stream)
    if (reader := reader_of(head)) is not None:
        return reader.takeoffs(reader.read(stream, companion))
    if recognise(head) is Format.ZEROS:
        raise refused(NEVER_WRITTEN, "Copy the file again, or use another log of the flight.")
    suffix = PurePath(name).suffix.lower()
    if suffix == ".log":
        raise TrajectoryError(
            f"{PurePath(name).name[:80]} contains no flight.",
            hint="A .log file goes with Paparazzi's .data file of the same name: choose both.",
            problems=(Problem("file", "is a companion file, not a record"),),
        )
    if suffix in READERS:
        expected = READERS[Format(suffix)].title
        raise TrajectoryError(
            f"{PurePath(name).name[:80]} does not match its file extension.",
            hint=f"A {suffix} file is {expected}; check that it was copied completely. Supported: "
            f"{', '.join(SUFFIXES)}.",
            problems=(Problem("file", "is empty" if not head else f"does not start like {expected}"),),
        )
    trajectory = read_takeoff_csv(stream)
    return (Takeoff(number=1, start_s=0.0, begins_with="the command", trajectory=trajectory, gains={}),)


def read_takeoff(
    stream: BinaryIO, *, name: str = "", number: int | None = None, companion: BinaryIO | None = None
) -> Takeoff:
    """Read one takeoff of a log by its number, or the only one.

    Raises TrajectoryError, listing them, if it is not clear which one is meant.
    """
    return choose(read_takeoffs(stream, name=name, companion=companion), number)


def read_content(content: bytes, *, name: str, number: int | None, companion: bytes | None) -> Takeoff:
    """As `read_takeoff`, for files in memory, so that it can run in a separate process."""
    beside = None if companion is None else BytesIO(companion)
    return read_takeoff(BytesIO(content), name=name, number=number, companion=beside)
