"""State machines as data: checks of transitions, actions and versions."""

from collections.abc import Mapping
from enum import StrEnum
from typing import TypeVar

from app.common.errors import ConflictError, Problem

S = TypeVar("S", bound=StrEnum)


def check_transition(moves: Mapping[S, frozenset[S]], state: S, to: S, what: str) -> S:
    """Return the new state. Raises ConflictError when the table has no transition to it from `state`."""
    if to not in moves[state]:
        raise ConflictError(f"{what} is {state} and cannot become {to}.", hint=_look_again(sorted(moves[state])))
    return to


def check_action(actions: Mapping[str, frozenset[S]], action: str, state: S, what: str) -> None:
    """Raise ConflictError when `action` is not possible in `state`."""
    if state not in actions[action]:
        raise ConflictError(
            f"{what} is {state}; “{action}” is possible only while it is {_or(actions[action])}.",
            hint="Reload it: its state has changed, or another step must come first.",
        )


def allowed(actions: Mapping[str, frozenset[S]], state: S) -> list[str]:
    """Actions possible in `state`, in the table's order."""
    return [action for action, states in actions.items() if state in states]


def check_version(sent: int, held: int, what: str, differences: Mapping[str, tuple[object, object]]) -> None:
    """Raise ConflictError when the edit was made on an outdated version.

    `differences`: for each edited field, the present and the sent value; those that differ are named.
    """
    if sent == held:
        return
    problems = tuple(
        Problem(field, f"is now {_short(now)}; you sent {_short(wanted)}")
        for field, (now, wanted) in differences.items()
        if now != wanted
    )
    raise ConflictError(
        f"{what} was changed by another client (current version {held}, you edited version {sent}).",
        hint="Reload it, review the changes, then repeat your edit.",
        problems=(Problem("version", f"is {held}, got {sent}"), *problems),
    )


def _short(value: object) -> str:
    text = f"“{value}”"
    return text if len(text) <= 80 else f"{text[:78]}…”"


def _or(states: frozenset[S]) -> str:
    *others, last = sorted(states)
    return f"{', '.join(others)} or {last}" if others else last


def _look_again(possible: list[S]) -> str:
    return f"Reload it; from here it can become {', '.join(possible)}." if possible else "This state is final."
