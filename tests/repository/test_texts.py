"""No code of the application decides by a sentence that a person reads: codes decide, sentences are made of them."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.repository.test_words import nodes

APP: Final = Path(__file__).resolve().parents[2] / "app"

TEXTS: Final = frozenset(
    {
        *("reason", "given_reason", "stop_reason", "overrule_reason", "why", "remark", "remarks", "doubt"),
        *("problem", "concern", "trouble", "sentence", "hint", "words", "verdict_text", "explanation"),
        *("FAILURE_TEXTS", "end_text", "cause_text", "request_text", "unstaged_text", "requested", "reason_of"),
        *("identity_change", "find_missing_uid", "duplicate_reason"),
    }
)
"""Fields, variables, tables and functions whose values people read."""
_SEARCHES: Final = frozenset(
    {"startswith", "endswith", "removeprefix", "find", "index", "rfind", "count", "partition", "split", "search"}
    | {"match", "fullmatch", "findall", "finditer"}
)
EXCEPTIONS: Final = {
    "verdict.reason == 'battery low'": "the reason of a stop verdict is a code",
    "reason in message": "SQLite's own words, where its driver has no code",
    "concern != slot.concern": "whether it has changed, not what it says",
    "change not in self.why": "the same, of a vehicle's identity that its operator has seen",
}
"""Code that may compare, and why."""


def comparisons(source: str) -> Iterator[str]:
    """Code that compares a text, searches it, or matches it against a pattern."""
    for node in nodes(source):
        match node:
            case ast.Compare(left=left, ops=ops, comparators=others):
                sides = (left, *others)
                kinds = (ast.Eq, ast.NotEq, ast.In, ast.NotIn)
                is_found = any(isinstance(op, kinds) for op in ops) and any(map(is_text, sides))
            case ast.Call(func=ast.Attribute(value=value, attr=attr), args=arguments):
                is_found = attr in _SEARCHES and (is_text(value) or any(map(is_text, arguments)))
            case ast.MatchValue(value=value):
                is_found = is_text(value)
            case _:
                is_found = False
        if is_found:
            yield ast.unparse(node)


def is_text(node: ast.AST) -> bool:
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name.lstrip("_") in TEXTS
        case ast.Call(func=ast.Attribute(value=value, attr=attr)):
            return attr.lstrip("_") in TEXTS or (
                attr in {"lower", "casefold", "strip", "lstrip", "rstrip"} and is_text(value)
            )
        case ast.Call(func=inner) | ast.NamedExpr(value=inner) | ast.Subscript(value=inner):
            return is_text(inner) or (isinstance(node, ast.NamedExpr) and is_text(node.target))
        case _:
            return False


def test_no_code_decides_by_a_sentence() -> None:
    found = {code: path.name for path in sorted(APP.rglob("*.py")) for code in comparisons(path.read_text())}
    assert {code: name for code, name in found.items() if code not in EXCEPTIONS} == {}
    assert EXCEPTIONS.keys() <= found.keys(), "an exception that nothing needs"


@pytest.mark.parametrize(
    "decision",
    [
        "record.reason.startswith(begins)",
        "trial.reason == flight.problem",
        "'by the operator' in end_text(end)",
        "re.match(pattern, self._why)",
        "reason_of(row).lower() != title",
        "(found := request_text(request)) in texts",
    ],
)
def test_a_decision_by_a_sentence_is_found(decision: str) -> None:
    assert list(comparisons(decision)) == [decision]


@pytest.mark.parametrize(
    "use", ["f'Aborted: {row.reason}'", "row.reason or end_text(row.end)", "end.failure == failure"]
)
def test_the_use_of_a_sentence_is_none(use: str) -> None:
    assert list(comparisons(use)) == []
