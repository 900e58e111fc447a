"""Settings of strategies and experiments, and validation of their values."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from app.core.definition import OptionValue
from app.core.errors import Problem
from app.core.policy import is_finite, shortened


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One setting: one of `choices`, or any number of the default's type within `lower` … `upper`."""

    name: str
    title: str
    default: OptionValue
    choices: tuple[OptionValue, ...] = ()
    unit: str = ""
    lower: float | None = None
    upper: float | None = None

    def refusal(self, value: OptionValue) -> str | None:
        """Why `value` is not allowed, or None if it is."""
        return self._not_a_choice(value) if self.choices else self._no_number(value)

    def _not_a_choice(self, value: OptionValue) -> str | None:
        if any(value == choice and type(value) is type(choice) for choice in self.choices):
            return None
        return f"must be one of {', '.join(str(choice).lower() for choice in self.choices)}, got {value!r}"

    def _no_number(self, value: OptionValue) -> str | None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return f"must be a number, got {value!r}"
        if not is_finite(value):
            return f"must be a finite number, got {shortened(value)}"
        if isinstance(self.default, int) and value != int(value):
            return f"must be a whole number, got {value:g}"
        if (self.lower is not None and value < self.lower) or (self.upper is not None and value > self.upper):
            return f"must lie in {_edge(self.lower)} … {_edge(self.upper)} {self.unit}".rstrip() + f", got {value:g}"
        return None


def problems_of_options(
    chosen: Mapping[str, OptionValue], offered: Sequence[Option], *, field: str, owner: str
) -> Iterator[Problem]:
    """Every setting in `chosen` that `owner` does not have, or whose value is not allowed."""
    known = {option.name: option for option in offered}
    for name, value in chosen.items():
        if name not in known:
            yield Problem(f"{field}.{name}", f"is not an option of {owner} (it has: {', '.join(known) or 'none'})")
        elif (reason := known[name].refusal(value)) is not None:
            yield Problem(f"{field}.{name}", reason)


def with_defaults(chosen: Mapping[str, OptionValue], offered: Sequence[Option]) -> dict[str, OptionValue]:
    """Every setting: the chosen value, else the default."""
    return {option.name: chosen.get(option.name, option.default) for option in offered}


def _edge(limit: float | None) -> str:
    return "any" if limit is None else f"{limit:g}"
