"""A file with which gains are loaded into an autopilot, the same from a log and from a campaign."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterFormat:
    """How an autopilot's gains are written: the end of the file's name, a `comment` around its text, the `lines` of
    values by name for the vehicle with a system id, and the name in the file of one in the recordings."""

    suffix: str
    comment: str
    lines: Callable[[Mapping[str, float], int], Sequence[str]]
    named: Callable[[str], str] = str

    def changes(self, old: Mapping[str, float], new: Mapping[str, float], system: int = 1) -> list[str]:
        """Lines with the new values, the old ones as comments before them."""
        return [
            *(self.comment.format(f"{self.named(name)} was {value:g}") for name, value in old.items()),
            *self.lines({self.named(name): value for name, value in new.items()}, system),
        ]

    def content(self, heading: str, old: Mapping[str, float], new: Mapping[str, float], system: int = 1) -> str:
        """The whole file, with a heading in one line."""
        line = " ".join(heading.replace("--", "-").split())
        return "\n".join((self.comment.format(line), *self.changes(old, new, system), ""))


NAMES_AND_VALUES: Final = ParameterFormat(
    suffix=".param",
    comment="# {}",
    lines=lambda values, _system: [f"{name},{value:g}" for name, value in values.items()],
)
"""As Mission Planner and MAVProxy load them."""
