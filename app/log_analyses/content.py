"""Content of an uploaded log, in the process that reads it: what a campaign starts with, and its analysis."""

import io
from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeVar

from app.autopilots.autopilot import Autopilot
from app.autopilots.log_readers import Reader, reader_of
from app.autopilots.recording import Recording
from app.autopilots.replica_check import LoopReplica, ReplicaCheck
from app.autopilots.replicas import REPLICAS, traced
from app.autopilots.takeoffs import Takeoff
from app.campaigns.schemas import Definition
from app.common.schemas import ProblemField
from app.core.analysis.analysis import analyze
from app.core.analysis.loop import LoggedFlight
from app.core.errors import InputError, Problem, TrajectoryError
from app.core.formatting import capitalised
from app.core.tuning.logged_takeoffs import analyze_takeoffs
from app.figures.panels import Plot
from app.log_analyses import manoeuvres, replicas, takeoffs
from app.log_analyses.schemas import LogAnswer, Part, Refusal, ReplicaAnswer, TuningAnswer
from app.logs.base import HEAD_BYTES
from app.logs.formats import NEVER_WRITTEN, Format, recognise

ANALYSED: Final = (
    "ArduCopter's .bin log, PX4's .ulg log, a .tlog of altitude steps under either, or Paparazzi's .data or .tlog log "
    "of a takeoff"
)
_OTHER_FILES: Final[Mapping[Format | None, str]] = {
    Format.GZIP: "is compressed (gzip): unpack it first",
    Format.ZIP: "is an archive (zip): unpack it first",
    Format.SDLOG2: "is a log of PX4 1.4 or older (.px4log), which is not supported",
    Format.ZEROS: NEVER_WRITTEN,
}

Answer = TypeVar("Answer", TuningAnswer, ReplicaAnswer)


def _decoded(
    content: bytes, companion: bytes | None, name: str, vehicle: int | None = None
) -> tuple[Reader, Recording]:
    """The reader of a log, and the recording of the vehicle with this system id, or the one with the most to learn."""
    head = content[:HEAD_BYTES]
    reader = reader_of(head)
    if reader is None:
        what = _OTHER_FILES.get(recognise(head), "is not a log") if head else "is empty"
        hint = f"Use {ANALYSED}, or a trace of the vertical loop with one row per step, .csv or .csv.gz."
        raise TrajectoryError(f"{name} cannot be used.", hint=hint, problems=(Problem("file", what),))
    recording = reader.read(io.BytesIO(content), None if companion is None else io.BytesIO(companion))
    return reader, reader.vehicle(recording, name, vehicle)


def read_start(content: bytes, companion: bytes | None, name: str) -> Sequence[Takeoff] | Definition:
    """Read what a campaign starts with: the takeoffs of a Paparazzi log, or its definition with the gains proposed from
    a copter's, which takes some seconds. Raises InputError that names what is missing or wrong."""
    reader, recording = _decoded(content, companion, name)
    flown = reader.flown(recording, name)
    return manoeuvres.start_of(analyze(flown), name) if isinstance(flown, LoggedFlight) else flown


def analyze_content(
    content: bytes, companion: bytes | None, name: str, gains: str = "", vehicle: int | None = None
) -> tuple[LogAnswer, dict[Part, list[Plot]]]:
    """The answer of a log or trace in memory, and the figures of its parts; takes some seconds.

    `gains` are `KP,KI,KD` as flown, if the log does not contain them; `vehicle` is the system id of the one to analyse,
    by default that with the most to learn. Raises InputError that names what is missing or wrong where neither part has
    an answer.
    """
    autopilot = traced(content[:HEAD_BYTES])
    if autopilot is None:
        reader, recording = _decoded(content, companion, name, vehicle)
        autopilot = recording.autopilot
        tuning, plots = _answered(lambda: _tuning(reader.flown(recording, name), name))
        if isinstance(tuning, TuningAnswer):
            notes = [*tuning.notes, *(f"{capitalised(note)}." for note in recording.notes)]
            tuning = tuning.model_copy(update={"notes": notes})
        checked = _answered(lambda: _checked(autopilot, lambda loop: loop.check_log(recording, name, gains)))
    else:
        hint = f"For better gains use {ANALYSED}."
        tuning, plots = InputError(f"{name} is a trace of the loop, not the log of a flight.", hint=hint), []
        checked = _checked(autopilot, lambda loop: loop.check_trace(io.BytesIO(content), name))
    replica, overlays = checked
    if isinstance(tuning, InputError) and isinstance(replica, InputError):
        asks_for_gains = any(problem.field == "gains" for problem in replica.problems)
        raise replica if asks_for_gains else tuning
    answer = LogAnswer(
        file_name=name, autopilot=autopilot.title, tuning=_or_refusal(tuning), replica=_or_refusal(replica)
    )
    return answer, {"tuning": plots, "replica": overlays}


def _tuning(flown: LoggedFlight | Sequence[Takeoff], name: str) -> tuple[TuningAnswer, list[Plot]]:
    if isinstance(flown, LoggedFlight):
        flight = analyze(flown)
        return manoeuvres.answer_of(flight, name, flown.assumed), [manoeuvres.plot_of(flight)]
    takeoff = analyze_takeoffs(takeoffs.logged_takeoffs(flown, name=name))
    return takeoffs.answer_of(takeoff, name), [takeoffs.plot_of(takeoff)]


def _checked(autopilot: Autopilot, check: Callable[[LoopReplica], ReplicaCheck]) -> tuple[ReplicaAnswer, list[Plot]]:
    loop = REPLICAS.get(autopilot)
    if loop is None:
        hint = "Its logs are analysed without it."
        raise InputError(f"Gainline has no replica of {autopilot.title}'s vertical loop.", hint=hint)
    found = check(loop)
    return replicas.answer_of(found), replicas.plots_of(found, loop)


def _answered(part: Callable[[], tuple[Answer, list[Plot]]]) -> tuple[Answer | InputError, list[Plot]]:
    try:
        return part()
    except InputError as error:
        return error, []


def _or_refusal(part: Answer | InputError) -> Answer | Refusal:
    if not isinstance(part, InputError):
        return part
    problems = [ProblemField.view_of(each) for each in part.problems]
    return Refusal(title=part.message, hint=part.hint, problems=problems)
