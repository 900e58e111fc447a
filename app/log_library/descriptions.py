"""The answer of a log from which no gains follow, for a person: what of its flight is known, and margins of the gains
flown and those of rules on the usual copter."""

from collections.abc import Iterator
from typing import Final

from app.core.analysis.analysis import Grade
from app.core.analysis.description import Description
from app.core.analysis.hand_rules import UsualMargins
from app.core.analysis.margin import EXTRA_LAG_S, REQUIRED_MARGIN
from app.core.errors import InputError, Problem
from app.core.formatting import percent
from app.core.reasons import ReasonCode
from app.log_library.manoeuvres import margin_text
from app.log_library.schemas import (
    Facts,
    PartTexts,
    ReasonField,
    TextTable,
    TuningAnswer,
    UsualNumbers,
)

_DESCRIBED: Final = "The log describes its flight, and does not suffice to judge gains."
_MENTIONED_SHARE: Final = 0.005


def answer_of(
    why: InputError, description: Description | None, margins: UsualMargins | None
) -> tuple[TuningAnswer, PartTexts]:
    """The answer of a log that was refused, in numbers and for a person: with a `description` it has one, with
    `margins` these too."""
    grade = Grade.REFUSED if description is None else Grade.DESCRIPTION if margins is None else Grade.PARTIAL
    answer = TuningAnswer(
        grade=grade,
        reasons=reasons_of(why, ReasonCode.UNUSABLE),
        numbers=None if margins is None else UsualNumbers(vehicle=margins.copter, assessments=margins.sets),
    )
    texts = texts_of(why)
    if margins is None:
        return answer, texts if description is None else texts.model_copy(update={"answer": _DESCRIBED})
    notes = [*_notes(margins), *texts.notes]
    return answer, texts.model_copy(update={"answer": _answer(margins), "table": _table(margins), "notes": notes})


def reasons_of(why: InputError, unnamed: ReasonCode) -> list[ReasonField]:
    """Its problems as reasons; those without a code have `unnamed`."""
    return [ReasonField.view_of(each, code=each.code or unnamed.key) for each in why.problems]


def texts_of(why: InputError) -> PartTexts:
    """A refusal for a person."""
    return PartTexts(answer=why.message, reasons=[_sentence(each) for each in why.problems], notes=[why.hint])


def _sentence(problem: Problem) -> str:
    """`PSCD is missing.`, `The log has no data.`"""
    subject = "The log" if problem.field == "file" or "flown_s" in problem.numbers else problem.field
    return f"{subject} {problem.reason.removesuffix('.')}."


def flight_facts(description: Description) -> Facts:
    """The whole flight in a line."""
    return Facts(title="Whole flight", values=list(_facts(description)))


def _facts(found: Description) -> Iterator[str]:
    yield f"{found.flown_s:.0f} s in the air"
    if found.held_s:
        yield f"{found.held_s:.0f} s with the altitude held"
    if found.hover_throttle is not None:
        yield f"hover throttle {found.hover_throttle:.3f} ± {found.hover_throttle_deviation:.3f}"
    if found.deviation_mean_m is not None and found.deviation_largest_m is not None:
        yield f"mean deviation {_length(found.deviation_mean_m)}, maximum {_length(found.deviation_largest_m)}"
    if (line := found.oscillation) is not None:
        yield f"oscillation of ±{_length(line.amplitude_m)} at {line.frequency_hz:.2f} Hz since {line.since_s:.0f} s"
    elif found.searched_s:
        yield "no oscillation"
    if found.saturated_share is not None and found.saturated_share >= _MENTIONED_SHARE:
        yield f"throttle at a limit in {percent(found.saturated_share)} of the samples"


def _length(metres: float) -> str:
    return f"{metres:.2f} m" if metres >= 1.0 else f"{1e3 * metres:.0f} mm"


def _answer(margins: UsualMargins) -> str:
    flown, hover = margins.sets[0], margins.copter.hover_throttle
    return (
        "The log does not suffice to propose gains. On a usual copter that hovers at a throttle of "
        f"{hover:.2f} the gains flown have a margin of {margin_text(flown.margin)}; {REQUIRED_MARGIN:g} is advised."
    )


def _table(margins: UsualMargins) -> TextTable:
    prefix, sets = margins.loop.texts.prefix, margins.sets
    return TextTable(
        title="On a usual copter with this hover throttle",
        columns=["Gains", *(name.removeprefix(prefix) for name in sets[0].gains), "Margin"],
        rows=[[each.name, *(f"{value:g}" for value in each.gains.values()), margin_text(each.margin)] for each in sets],
    )


def _notes(margins: UsualMargins) -> list[str]:
    texts, copter = margins.loop.texts, margins.copter
    margin = f"the factor by which {texts.fast_gains} can be raised before the loop rings"
    usual = f"slope {copter.thrust_slope:g}, lag {1e3 * copter.motor_lag_s:.0f} ms and drag {copter.drag_1_s:g} 1/s"
    return [
        f"Margin: {margin}, with {1e3 * EXTRA_LAG_S:.0f} ms of extra {texts.lateness}.",
        f"The hover throttle is of the log; {usual} are usual, not found: on another vehicle the margin differs.",
    ]
