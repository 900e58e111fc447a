"""What documents and the command line write alike about logs: an answer part by part, its numbers, and parameters."""

from typing import Final

import numpy as np

from app.core.analysis.analysis import Grade
from app.core.formatting import NOTHING, number
from app.log_library.library_schemas import LogComparison, LogNumbers
from app.log_library.schemas import LogAnswer, Part, PartTexts, Refusal
from app.log_library.trends import QUANTITIES


def parts_of(answer: LogAnswer) -> tuple[tuple[Part, str, PartTexts], ...]:
    """Both parts with their titles: the gains and the replica; the replica first if it alone answers."""
    tuning: tuple[Part, str, PartTexts] = "tuning", f"Gains ({answer.tuning.grade})", answer.texts.tuning
    replica: tuple[Part, str, PartTexts] = "replica", "Replica of the controller", answer.texts.replica
    is_first = answer.tuning.grade is Grade.REFUSED and not answers_nothing(answer)
    return (replica, tuning) if is_first else (tuning, replica)


def answers_nothing(answer: LogAnswer) -> bool:
    """Whether neither part answers."""
    return answer.tuning.grade is Grade.REFUSED and isinstance(answer.replica, Refusal)


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


def _value(parameter: float | None) -> str:
    """As many digits as tell it from every other value: of single precision, if it has that."""
    if parameter is None:
        return NOTHING
    single = np.float32(parameter)
    return f"{parameter:.0f}" if parameter.is_integer() else str(single if single == parameter else parameter)
