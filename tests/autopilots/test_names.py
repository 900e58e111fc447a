"""What is known of one autopilot is in its folder: elsewhere no code names one."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tests.repository.test_words import typescript_identifiers

ROOT: Final = Path(__file__).resolve().parents[2]
NAMES: Final = re.compile(r"ardupilot|arducopter|px4|paparazzi", re.IGNORECASE)
HOME: Final = re.compile(r"app\.autopilots\.\w+")

LEFT: Final = {
    # The replicas, and what is built of them: vertical.py and horizontal.py of each folder, once they move there.
    "app/core/analysis": 4,
    "app/core/control": 13,
    "app/core/experiments": 7,
    "app/core/models": 8,
    "app/core/tuning": 4,
    # Logs of one firmware, until they are read as recordings.
    "app/log_analyses": 5,
    "app/logs": 12,
    # The paper's loop, which the simulated vehicles and reproductions fly, and its command.
    "app/cli": 5,
    "app/reproductions": 1,
    "app/simdrone": 1,
    "app/vehicles": 6,
    "frontend/src": 5,
}
"""Uses in code by folder. The list may only become shorter."""


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


def uses(path: Path) -> int:
    source = path.read_text()
    words = python_names(source) if path.suffix == ".py" else typescript_identifiers(source)
    return sum(bool(NAMES.search(HOME.sub("", word))) for word in words)


def test_no_code_outside_its_folder_names_an_autopilot() -> None:
    files = [
        *(ROOT / "app").rglob("*.py"),
        *(path for path in (ROOT / "frontend" / "src").rglob("*.ts*") if ".test." not in path.name),
    ]
    found: dict[str, int] = {}
    for path in files:
        place = path.relative_to(ROOT).as_posix()
        if place.startswith(("app/autopilots/", "frontend/src/api/generated/")) or not (count := uses(path)):
            continue
        parts = place.split("/")
        folder = "/".join(parts[: 3 if parts[1] == "core" else 2])
        found[folder] = found.get(folder, 0) + count
    assert {folder: count for folder, count in found.items() if count > LEFT.get(folder, 0)} == {}
    assert [folder for folder in LEFT if folder not in found] == [], "take these off the list"
