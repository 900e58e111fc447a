"""State machines as data: checks of transitions, actions and versions."""

import tomllib
from collections.abc import Iterable, Mapping, Set
from enum import StrEnum
from pathlib import Path
from typing import Final, TypeVar

from app.common.errors import ConflictError, Problem

S = TypeVar("S", bound=StrEnum)

_WORDS: Final[Mapping[str, Mapping[str, str]]] = tomllib.loads(
    (Path(__file__).parent / "state_words.toml").read_text("utf-8")
)


def check_transition(moves: Mapping[S, frozenset[S]], state: S, to: S, what: str) -> S:
    """Return the new state. Raises ConflictError when the table has no transition to it from `state`."""
    if to not in moves[state]:
        raise ConflictError(
            f"{what} is {state_label(state)} and cannot change to “{state_label(to)}”.",
            hint=f"Reload it; from here it can change to “{_or(moves[state], '” or “', '”, “')}”."
            if moves[state]
            else "This state is final.",
        )
    return to


def check_action(actions: Mapping[str, frozenset[S]], action: str, state: S, what: str) -> None:
    """Raise ConflictError when `action` is not possible in `state`."""
    if state not in actions[action]:
        raise ConflictError(
            f"{what} {_WORDS['refusals'][action]}: it is {state_label(state)}.",
            hint=f"This is possible only while it is {_or(actions[action])}. Reload it: its state has changed, or "
            "another step must come first.",
        )


def allowed(
    actions: Mapping[str, frozenset[S]], state: S, ruled_out: Iterable[tuple[object, Set[str]]] = ()
) -> list[str]:
    """Actions possible in `state`, in the table's order, but for those that a true condition has `ruled_out`."""
    impossible = {action for applies, without in ruled_out if applies for action in without}
    return [action for action, states in actions.items() if state in states and action not in impossible]


def check_version(sent: int, held: int, what: str, differences: Mapping[str, tuple[object, object]]) -> None:
    """Raise ConflictError when the edit was made on an outdated version.

    `differences`: for each edited field, the present and the sent value; those that differ are named.
    """
    if sent == held:
        return
    problems = tuple(
        Problem(field, f"is now {_short(now)}; you entered {_short(wanted)}")
        for field, (now, wanted) in differences.items()
        if now != wanted
    )
    raise ConflictError(
        f"{what} has been changed elsewhere since you opened it.",
        hint="Reload it, review the changes, then repeat your edit.",
        problems=(Problem("version", f"is {held}, got {sent}"), *problems),
    )


def _short(value: object) -> str:
    text = f"“{value}”"
    return text if len(text) <= 80 else f"{text[:78]}…”"


def state_label(state: str) -> str:
    """The word that a person knows a state by."""
    return _WORDS["labels"].get(state, state)


def _or(states: Iterable[str], last_by: str = " or ", others_by: str = ", ") -> str:
    *others, last = sorted(map(state_label, states))
    return f"{others_by.join(others)}{last_by}{last}" if others else last
