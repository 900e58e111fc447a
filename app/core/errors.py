"""Errors of the numerical core; the application's own tree in `app.common.errors` has the same root.

GainlineError
└── InputError            unusable input
    ├── GainsError        a gain vector that may not be flown
    └── TrajectoryError   a recorded flight that cannot be scored
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Problem:
    """One refused field.

    `field` is its name as the caller wrote it (dotted, `gains.kp`), `reason` why it was refused; `offer` holds gains
    that would pass, by name, if any are known. `code` is for programs: of a record, the reason or the value of the
    field that would pass; of a log, the reason (`app.core.reasons`), with its `numbers`, by names that end in their
    unit, and what else it names in `named`.
    """

    field: str
    reason: str
    offer: Mapping[str, float] = dataclasses.field(default_factory=dict)
    code: str = ""
    numbers: Mapping[str, float] = dataclasses.field(default_factory=dict)
    named: Sequence[str] = ()


class GainlineError(Exception):
    """An error with a `message` (what happened and what it means) and a `hint` (what to do about it).

    `script_hint` is what a script does about it, where that differs; pages do not show it.
    """

    def __init__(self, message: str, *, hint: str, problems: tuple[Problem, ...] = (), script_hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.script_hint = script_hint
        self.problems = problems

    def __str__(self) -> str:
        return " ".join(
            (self.message, *(f"{p.field}: {p.reason.removesuffix('.')}." for p in self.problems), self.hint)
        )

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling between processes: the default rebuilds an exception from its message alone."""
        return _made_again, (type(self), self.args, self.__dict__)


def _made_again(kind: type[GainlineError], args: tuple[object, ...], state: dict[str, object]) -> GainlineError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class InputError(GainlineError):
    """External input that cannot be used; `problems` names the fields."""


class GainsError(InputError):
    """A gain vector that may not be flown."""


class TrajectoryError(InputError):
    """A recorded flight that cannot be scored."""
