"""Content of an uploaded log, in the process that reads it: what a campaign starts with, and its analysis."""

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Final, Generic, TypeVar

from app.autopilots.autopilot import Autopilot
from app.autopilots.described import loop_of, signals_of
from app.autopilots.frames import frame_of
from app.autopilots.log_readers import Reader, reader_of
from app.autopilots.recording import Recording, final_parameters
from app.autopilots.replica_check import LoopReplica, ReplicaCheck
from app.autopilots.replicas import REPLICAS, traced
from app.autopilots.takeoffs import Takeoff
from app.campaigns.schemas import Definition
from app.core.analysis.analysis import Grade, analyze
from app.core.analysis.combined_fit import LogFit, log_fit
from app.core.analysis.description import Description, describe
from app.core.analysis.hand_rules import UsualMargins, usual_margins
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.shapes import find_shapes
from app.core.errors import InputError, Problem, TrajectoryError
from app.core.formatting import capitalised
from app.core.reasons import UNNAMED_FRAME, ReasonCode
from app.core.statistics.gain_change import ScoredTakeoff
from app.core.tuning.logged_takeoffs import analyze_takeoffs, score_takeoffs
from app.figures.panels import Plot
from app.log_library import descriptions, manoeuvres, replicas, shapes, takeoffs
from app.log_library.flights import pack_flight
from app.log_library.library_schemas import AnalysedContent, LogNumbers
from app.log_library.schemas import LogAnswer, PartTexts, Refusal, ReplicaAnswer, Texts, TuningAnswer
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

_Answer = TypeVar("_Answer", TuningAnswer, ReplicaAnswer, Refusal)


def _decoded(content: bytes, companion: bytes | None, name: str) -> tuple[Reader, Recording]:
    """The reader of a log, and the recording of all its vehicles."""
    head = content[:HEAD_BYTES]
    reader = reader_of(head)
    if reader is None:
        what = _OTHER_FILES.get(recognise(head), "is not a log") if head else "is empty"
        hint = f"Use {ANALYSED}, or a trace of the vertical loop with one row per step, .csv or .csv.gz."
        raise TrajectoryError(f"{name} cannot be used.", hint=hint, problems=(Problem("file", what),))
    return reader, reader.read(io.BytesIO(content), None if companion is None else io.BytesIO(companion))


def read_start(
    content: bytes, companion: bytes | None, name: str, vehicle: int | None = None
) -> Sequence[Takeoff] | Definition:
    """Read what a campaign starts with: the takeoffs of a Paparazzi log, or its definition with the gains proposed from
    a copter's, which takes some seconds; of the `vehicle` as for `analyze_content`. Raises InputError that names what
    is missing or wrong."""
    reader, logged = _decoded(content, companion, name)
    flown = reader.flown(reader.vehicle(logged, name, vehicle), name)
    return manoeuvres.start_of(analyze(flown), name) if isinstance(flown, LoggedFlight) else flown


def analyze_content(
    content: bytes, companion: bytes | None, name: str, gains: str = "", vehicle: int | None = None
) -> AnalysedContent:
    """Analyse a log or trace in memory; takes some seconds.

    `gains` are `KP,KI,KD` as flown, if the log does not contain them; `vehicle` is the system id of the one to analyse,
    by default that with the most to learn. Raises InputError that names what is wrong with a file that cannot be read;
    what a log lacks is in its answer.
    """
    autopilot, release, frame, system = traced(content[:HEAD_BYTES]), "", "", None
    vehicles: dict[int, str] = {}
    replica: _Answered[ReplicaAnswer] | _Answered[Refusal]
    recording: Recording | None = None
    if autopilot is None:
        reader, logged = _decoded(content, companion, name)
        recording = reader.vehicle(logged, name, vehicle)
        autopilot, release, frame = recording.autopilot, recording.release, frame_of(recording)
        if logged.others:
            system, together = recording.system, (logged, *logged.others)
            vehicles = {each.system: each.autopilot.title for each in sorted(together, key=attrgetter("system"))}
        tuning = _tuning(reader, recording, name)
        is_other_kind = any(each.code == _OTHER_KIND for each in tuning.answer.reasons)
        refused = _Answered(Refusal(reasons=tuning.answer.reasons), PartTexts(answer=_OF_ROTORS))
        replica = refused if is_other_kind else _compared(recording, name, gains)
    else:
        hint = f"For better gains use {ANALYSED}."
        why = InputError(f"{name} is a trace of the loop, not the log of a flight.", hint=hint)
        tuning = _Answered(*descriptions.answer_of(why, None, None))
        replica = _checked(autopilot, lambda loop: loop.check_trace(io.BytesIO(content), name))
    answer = LogAnswer(
        file_name=name,
        autopilot=autopilot.title,
        release=release or None,
        frame=None if frame == UNNAMED_FRAME else frame or None,
        vehicle=system,
        vehicles=vehicles,
        tuning=tuning.answer,
        replica=replica.answer,
        texts=Texts(tuning=tuning.texts, replica=replica.texts),
    )
    found = AnalysedContent(
        answer=answer,
        autopilot=autopilot.name,
        plots={"tuning": tuning.plots, "replica": replica.plots},
        numbers=tuning.numbers,
        fit=tuning.fit,
        flight=tuning.flight,
        takeoffs=tuning.takeoffs,
        definition=tuning.definition,
    )
    if recording is None:
        return found
    return replace(
        found,
        hardware_id=recording.hardware_id,
        vehicle_name=recording.vehicle_name,
        flown_at=recording.started_at,
        parameters=final_parameters(recording),
    )


@dataclass(frozen=True, slots=True)
class _Answered(Generic[_Answer]):
    """A part of the answer: in numbers, for a person, and its figures; and what the library keeps of it."""

    answer: _Answer
    texts: PartTexts
    plots: list[Plot] = field(default_factory=list)
    numbers: LogNumbers = field(default_factory=LogNumbers)
    fit: LogFit | None = None
    flight: bytes | None = None
    takeoffs: Sequence[ScoredTakeoff] = ()
    definition: Definition | None = None


def _tuning(reader: Reader, recording: Recording, name: str) -> _Answered[TuningAnswer]:
    signals = signals_of(recording)
    description = None if signals is None else describe(signals)
    try:
        found = _analyzed(reader.flown(recording, name), name)
        notes = [*found.texts.notes, *(f"{capitalised(note)}." for note in recording.notes)]
        found = replace(found, texts=found.texts.model_copy(update={"notes": notes}))
    except InputError as error:
        codes = {each.code for each in error.problems}
        described = None if _OTHER_KIND in codes else description
        margins = None if codes & _DOUBTFUL else _margins(recording, described)
        found = _Answered(*descriptions.answer_of(error, described, margins))
    if signals is None or description is None or found.answer.grade is Grade.REFUSED:
        return found
    facts = [*found.texts.facts, descriptions.flight_facts(description)]
    seen = find_shapes(signals, description)
    return replace(
        found,
        numbers=found.numbers.completed_by(description),
        answer=found.answer.model_copy(update={"description": description, "shapes": shapes.fields_of(seen)}),
        texts=found.texts.model_copy(update={"facts": facts, "shapes": shapes.texts_of(seen)}),
    )


def _analyzed(flown: LoggedFlight | Sequence[Takeoff], name: str) -> _Answered[TuningAnswer]:
    if isinstance(flown, LoggedFlight):
        flight = analyze(flown)
        answer, texts = manoeuvres.answer_of(flight, name, flown.assumed)
        return _Answered(
            answer,
            texts,
            [manoeuvres.plot_of(flight)],
            numbers=manoeuvres.listed_numbers(flight),
            fit=log_fit(flight.estimate, flight.loop),
            flight=pack_flight(flown, flight.estimate.draws),
            definition=manoeuvres.start_of(flight, name) if answer.starts_campaign else None,
        )
    logged = takeoffs.logged_takeoffs(flown, name=name)
    takeoff = analyze_takeoffs(logged)
    answer, texts = takeoffs.answer_of(takeoff, name)
    return _Answered(
        answer,
        texts,
        [takeoffs.plot_of(takeoff)],
        numbers=takeoffs.listed_numbers(takeoff),
        takeoffs=score_takeoffs(logged),
    )


def _margins(recording: Recording, description: Description | None) -> UsualMargins | None:
    """Margins with the hover throttle of a flight, if its gains are known and it was no idling on the ground."""
    hover_throttle = None if description is None else description.hover_throttle
    if not hover_throttle:
        return None
    loop = loop_of(recording, recording.columns["altitude_m"].time_s[-1], hover_throttle)
    if loop is None or hover_throttle < loop.texts.hover_range[0]:
        return None
    return usual_margins(loop, hover_throttle)


_OF_ROTORS: Final = "It is of a copter with several rotors, so the log is not compared with it."
_OTHER_KIND: Final = ReasonCode.NOT_A_COPTER.key
_DOUBTFUL: Final = frozenset(
    each.key
    for each in (
        ReasonCode.CONSTANT_SIGNAL,
        ReasonCode.DERIVATIVE_REVERSED,
        ReasonCode.DEVIATION_NOT_EXPLAINED,
        ReasonCode.OTHER_CONTROLLER,
        ReasonCode.PARAMETER_READ_LATE,
        ReasonCode.PARAMETER_UNSUPPORTED,
        ReasonCode.UNEXPLAINED_ACCELERATIONS,
    )
)
"""Reasons why something else than the gains in the log may have flown."""


def _checked(autopilot: Autopilot, check: Callable[[LoopReplica], ReplicaCheck]) -> _Answered[ReplicaAnswer]:
    loop = REPLICAS.get(autopilot)
    if loop is None:
        hint = "Its logs are analysed without it."
        raise InputError(f"Gainline has no replica of {autopilot.title}'s vertical loop.", hint=hint)
    found = check(loop)
    return _Answered(*replicas.answer_of(found), replicas.plots_of(found, loop))


def _compared(recording: Recording, name: str, gains: str) -> _Answered[ReplicaAnswer] | _Answered[Refusal]:
    try:
        return _checked(recording.autopilot, lambda loop: loop.check_log(recording, name, gains))
    except InputError as error:
        reasons = descriptions.reasons_of(error, ReasonCode.NOT_COMPARED)
        return _Answered(Refusal(reasons=reasons), descriptions.texts_of(error))
