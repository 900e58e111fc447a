"""The glossary's rejected words stay out of identifiers and prose."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import pytest

ROOT = Path(__file__).resolve().parents[2]

IDENTIFIERS: Final = {
    "metaphors": r"(?:^|_)(?:hangar|seat|berth|crew|desk|deck|airspace|cockpit|hedge|books)s?(?:_|$)",
    "metaphors in class names": r"(?:Hangar|Seat|Berth|Crew|Desk|Deck|Airspace|Cockpit|Surveyor|Gauges|Glimpse|"
    r"Manners|Afflicted)(?=[A-Z]|s?$)",
    "foretelling": r"(?i:foret(?:ell|old)|foresee|foreseen|foresight)",
    "participles as class names": r"^(?:Said|Asked|Answered|Obeyed|Sighted|Doubled|Spoken|Told|Asker)$",
}
"""Patterns for one identifier, searched case-sensitively."""

LOCAL_NAMES: Final = r"^_?(?:said|told|spoken|teller)$|^_said_|^_told_"
"""Speech as the name of a value or function in the server, outside the vehicles' packages."""

PROSE: Final = {
    "metaphors": r"\b(?:hangars?|berths?|crew|airspace|cockpits?|lookout|(?:session|flight) deck|"
    r"(?:job|worker|vehicle)(?:'s)? (?:desk|seat|deck))\b",
    "foretelling": r"\bforet(?:ells?|old|elling)\b|\bfore(?:sees?|seen|sight)\b",
    "books": r"\b(?:keeps?|kept|in|into|fit|out of) the books\b|\bkeeps? books\b",
    "archaisms": r"\b(?:hitherto|whence|thence|thereof|ought)\b",
    "inversions": r"\bbe it\b|\bis none that\b|\bhas but\b|\bas ever\b",
    "the program's mistakes": r"\bmistakes? of (?:the program|ours)\b|\bthe program made a mistake\b",
}
"""Patterns for docstrings, comments, string literals and documents, searched in any case and across line breaks."""

SOURCES: Final = ("app", "tests", "bench", "frontend/src", "docs")
SUFFIXES: Final = {".py", ".ts", ".tsx", ".md", ".j2"}
LEFT_OUT: Final = (
    "frontend/src/api/generated/",  # made from the API
    "tests/data/",
    "docs/decisions/",  # history
    "tests/repository/test_words.py",
)


def checked_files() -> list[Path]:
    inside = [path for folder in SOURCES for path in (ROOT / folder).rglob("*") if path.suffix in SUFFIXES]
    documents = [path for path in ROOT.glob("*.md") if path.name != "CHANGELOG.md"]
    return sorted(path for path in [*inside, *documents, ROOT / "dev"] if not place(path).startswith(LEFT_OUT))


def place(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def is_python(path: Path) -> bool:
    return path.suffix in {".py", ""}


@cache
def nodes(source: str) -> list[ast.AST]:
    """Read once for both checks."""
    return list(ast.walk(ast.parse(source)))


def python_identifiers(source: str) -> Iterator[str]:
    """Names that this source defines or uses, attributes included."""
    for node in nodes(source):
        match node:
            case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.alias(name=name, asname=other):
                yield from (*name.split("."), *filter(None, (other,)))
            case ast.keyword(arg=str(name)) | ast.MatchAs(name=str(name)):
                yield name
            case _:
                pass


def typescript_identifiers(source: str) -> Iterator[str]:
    """Words of the source, without those in line comments and in texts that contain a space."""
    code = re.sub(r"//[^\n]*|/\*.*?\*/|\"[^\"\n]* [^\"\n]*\"|>[^<>{}]+<", " ", source, flags=re.DOTALL)
    yield from re.findall(r"\b[A-Za-z_]\w*\b", code)


def identifiers(path: Path, source: str) -> set[str]:
    if is_python(path):
        return set(python_identifiers(source))
    return set(typescript_identifiers(source)) if path.suffix in {".ts", ".tsx"} else set()


def prose(path: Path, source: str) -> str:
    """The text for people, with single spaces: strings and what follows a # of Python, anything of other files."""
    if not is_python(path):
        return " ".join(re.sub(r"^\s*(?://|\*|#)\s?", " ", source, flags=re.MULTILINE).split())
    strings = [node.value for node in nodes(source) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return " | ".join(" ".join(text.split()) for text in [*strings, *re.findall(r"#+ *(.*)", source)])


def rejected_identifiers(path: Path, source: str) -> list[str]:
    is_local = (
        is_python(path)
        and place(path).startswith("app/")
        and not place(path).startswith(("app/vehicles/", "app/simdrone/"))
    )
    return [name for name in sorted(identifiers(path, source)) if is_rejected(name, is_local=is_local)]


@cache
def is_rejected(name: str, *, is_local: bool) -> bool:
    patterns = [*IDENTIFIERS.values(), *([LOCAL_NAMES] if is_local else [])]
    return any(re.search(pattern, name) for pattern in patterns)


def rejected_prose(path: Path, source: str) -> list[str]:
    text = prose(path, source)
    found = [match for pattern in PROSE.values() for match in re.finditer(pattern, text, re.IGNORECASE)]
    return [text[max(0, match.start() - 40) : match.end() + 40] for match in found]


def test_no_identifier_is_a_rejected_word() -> None:
    found = {place(path): rejected_identifiers(path, path.read_text()) for path in checked_files()}
    assert {name: words for name, words in found.items() if words} == {}


def test_no_text_contains_a_rejected_word() -> None:
    found = {place(path): rejected_prose(path, path.read_text()) for path in checked_files()}
    assert {name: texts for name, texts in found.items() if texts} == {}


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("app/jobs/desk.py", "def close_desk() -> None: ..."),
        ("app/jobs/desk.py", "class FlightDeck: ..."),
        ("app/jobs/desk.py", "value = predictor.foretell(gains)"),
        ("app/jobs/desk.py", "def end(said: str) -> None: ..."),
        ("frontend/src/fly.ts", "const cockpit = open();"),
        ("frontend/src/fly.tsx", "export function FlightDeck() {}"),
    ],
)
def test_a_rejected_identifier_is_found(name: str, source: str) -> None:
    assert len(rejected_identifiers(ROOT / name, source)) == 1


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("app/jobs/desk.py", '"""A berth for each\n    vehicle."""'),
        ("app/jobs/desk.py", "x = 1  # the error that was foretold"),
        ("app/jobs/desk.py", 'raise ValueError("What is kept in "\n"the books.")'),
        ("docs/guide.md", "An error is a mistake of\nthe program."),
        ("frontend/src/fly.tsx", "<p>The program made a mistake.</p>"),
    ],
)
def test_a_rejected_word_in_a_text_is_found(name: str, source: str) -> None:
    assert len(rejected_prose(ROOT / name, source)) == 1


def test_words_of_the_field_are_not_rejected() -> None:
    source = '"""32-bit words on deck: predictions, and the person who reviews them."""\nword = registry.book(desktop)'
    path = ROOT / "app/jobs/runner.py"
    assert (rejected_identifiers(path, source), rejected_prose(path, source)) == ([], [])
