"""Errors of the numerical core; the application's own tree in `app.errors` grows from the same root.

GainlineError
└── InputError            something that came in is not usable
    ├── GainsError        a gain vector that may not be flown
    └── TrajectoryError   a recorded flight that cannot be scored
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Problem:
    """One refused field: its name as the caller wrote it (dotted, `gains.kp`), and why it was refused; `offer` holds
    values of gains that would pass, by name, where any are known."""

    field: str
    reason: str
    offer: Mapping[str, float] = dataclasses.field(default_factory=dict)


class GainlineError(Exception):
    """What happened and what it means (`message`), and what to do about it (`hint`)."""

    def __init__(self, message: str, *, hint: str, problems: tuple[Problem, ...] = ()) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.problems = problems

    def __str__(self) -> str:
        return " ".join(
            (self.message, *(f"{p.field}: {p.reason.removesuffix('.')}." for p in self.problems), self.hint)
        )

    def __reduce__(self) -> tuple[object, ...]:
        """For the way between processes: an exception's own is to be made of its message alone."""
        return _made_again, (type(self), self.args, self.__dict__)


def _made_again(kind: type[GainlineError], args: tuple[object, ...], state: dict[str, object]) -> GainlineError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class InputError(GainlineError):
    """Something that came in from outside cannot be used; `problems` names the fields."""


class GainsError(InputError):
    """A gain vector that may not be flown."""


class TrajectoryError(InputError):
    """A recorded flight that cannot be scored."""
