"""What documents and the command line write alike about logs: an answer part by part, its numbers, and parameters."""

from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Final

import numpy as np

from app.core.analysis.analysis import Grade
from app.core.formatting import NOTHING, count, number
from app.core.statistics.comparisons import Verdict
from app.core.statistics.gain_change import GainChange
from app.log_library.library_schemas import LogComparison, LogNumbers
from app.log_library.schemas import LogAnswer, Part, PartTexts, Refusal


def parts_of(answer: LogAnswer) -> tuple[tuple[Part, str, PartTexts], ...]:
    """Both parts with their titles: the gains and the replica; the replica first if it alone answers."""
    tuning: tuple[Part, str, PartTexts] = "tuning", f"Gains ({answer.tuning.grade})", answer.texts.tuning
    replica: tuple[Part, str, PartTexts] = "replica", "Replica of the controller", answer.texts.replica
    is_first = answer.tuning.grade is Grade.REFUSED and not answers_nothing(answer)
    return (replica, tuning) if is_first else (tuning, replica)


def answers_nothing(answer: LogAnswer) -> bool:
    """Whether neither part answers."""
    return answer.tuning.grade is Grade.REFUSED and isinstance(answer.replica, Refusal)


QUANTITIES: Final[Sequence[tuple[str, int, Callable[[LogNumbers], float | None]]]] = (
    ("Hover throttle", 3, lambda found: None if found.hover_throttle is None else found.hover_throttle.mean),
    ("Mean deviation (mm)", 1, lambda found: None if found.deviation_m is None else 1e3 * found.deviation_m),
    ("Throttle activity", 4, attrgetter("activity")),
    ("Margin", 1, attrgetter("margin")),
)
"""Title, decimals and value of a number of a log."""
NUMBERS: Final = tuple(title for title, *_ in QUANTITIES)
"""Titles of the numbers of a log."""


def number_texts(log: LogNumbers) -> tuple[str, ...]:
    """The numbers of a log, by their titles."""
    return tuple(number(value_of(log), digits) for _, digits, value_of in QUANTITIES)


def measured_texts(found: LogComparison) -> list[tuple[str, str, str]]:
    """Title and both values of each number that one of two logs has, the earlier log's first."""
    texts = zip(NUMBERS, number_texts(found.before.numbers), number_texts(found.log.numbers), strict=True)
    return [each for each in texts if each[1:] != (NOTHING, NOTHING)]


def changed_texts(found: LogComparison) -> list[tuple[str, str, str, str]]:
    """Name, both values and group of each parameter that is not the same in two logs."""
    return [(each.name, _value(each.before), _value(each.after), each.group) for each in found.parameters]


_SENTENCES: Final[Mapping[Verdict | None, str]] = {
    "better": "The gains of this log are better.",
    "worse": "The gains of this log are worse.",
    "unresolved": "The gains differ by less than two flights with the same gains do.",
    "not known yet": "The gains are not compared: a log does not have what its model needs.",
    None: "Both logs have the same altitude gains.",
}
_CONTRADICTED: Final = (
    "The flights went the other way. The weather has changed much, or something happened that the model does not know: "
    "vibration, a loose propeller, another load."
)


def sentence_of(change: GainChange) -> str:
    """Which gains are better."""
    return _SENTENCES[change.verdict]


def notes_of(change: GainChange) -> list[str]:
    """What the measured difference comes from, and what the verdict leaves open."""
    gains_m, manoeuvre_m, weather_m = change.by_gains_m, change.by_manoeuvre_m, change.by_weather_m
    causes = (("the gains", gains_m), ("the manoeuvre", manoeuvre_m), ("the weather", weather_m))
    known = ", ".join(f"{1e3 * metres:+.1f} mm to {what}" for what, metres in causes if metres is not None)
    attributed = f"; the models attribute {known}" if known else ""
    further = change.comparison and change.comparison.further
    notes = [] if change.measured_m is None else [f"Measured: {1e3 * change.measured_m:+.1f} mm{attributed}."]
    notes += [f"{count(further.total, 'further flight')} would decide, if the difference stays."] if further else []
    notes += [_CONTRADICTED] if change.is_contradicted else []
    return [each.replace("-", "−") for each in notes]


def _value(parameter: float | None) -> str:
    """As many digits as tell it from every other value: of single precision, if it has that."""
    if parameter is None:
        return NOTHING
    single = np.float32(parameter)
    return f"{parameter:.0f}" if parameter.is_integer() else str(single if single == parameter else parameter)
