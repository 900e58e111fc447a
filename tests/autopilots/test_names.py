"""What is known of one autopilot is in its folder: elsewhere no code names one."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tests.repository.test_words import typescript_identifiers

ROOT: Final = Path(__file__).resolve().parents[2]
NAMES: Final = re.compile(r"ardupilot|arducopter|px4|paparazzi", re.IGNORECASE)

EXCEPTIONS: Final = {
    "app/reproductions/controller.py": "the paper's Fig. 6 replays a recording of Paparazzi's controller",
}
"""Files that name an autopilot in code, and why. At most ten."""


def python_names(source: str) -> Iterator[str]:
    """Identifiers, modules, and strings that are one word: not texts."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name) | ast.keyword(arg=str(name)):
                yield name
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.alias(name=name, asname=other):
                yield from (name, other or "")
            case ast.ImportFrom(module=str(name)):
                yield name
            case ast.Constant(value=str(text)) if " " not in text:
                yield text
            case _:
                pass


def names_in(path: Path) -> set[str]:
    source = path.read_text()
    words = python_names(source) if path.suffix == ".py" else typescript_identifiers(source)
    return {word for word in words if NAMES.search(word)}


def test_no_code_outside_its_folder_names_an_autopilot() -> None:
    files = [
        *(ROOT / "app").rglob("*.py"),
        *(path for path in (ROOT / "frontend" / "src").rglob("*.ts*") if ".test." not in path.name),
    ]
    found = {
        place: names
        for path in files
        if not (place := path.relative_to(ROOT).as_posix()).startswith(
            ("app/autopilots/", "frontend/src/api/generated/")
        )
        and (names := names_in(path))
    }
    assert {place: names for place, names in found.items() if place not in EXCEPTIONS} == {}
    assert [place for place in EXCEPTIONS if place not in found] == [], "take these off the list"
    assert len(EXCEPTIONS) <= 10
