"""The paths of a gain set and of a sample in CONTRIBUTING.md are those of the code, and short."""

import re
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).resolve().parents[2]
LONGEST: Final = {"a gain set": 13, "an altitude sample": 9}
"""Files that hand each of them on. A number may only become smaller."""
ROW: Final = re.compile(r"^\| `([^`]+)` \| (.*) \| (.*) \| (.*)\|$", re.MULTILINE)


def rows(what: str) -> list[tuple[Path, str, list[str]]]:
    """Each file of a path, with what it takes and gives, and the files that it asks."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    section = text.split(f"### The path of {what},")[1].split("\n#")[0]
    return [
        (ROOT / file, f"{taken} {given}", re.findall(r"`([^`]+)`", asked))
        for file, taken, given, asked in ROW.findall(section)
    ]


@pytest.mark.parametrize("what", LONGEST)
def test_a_path_is_no_longer_than_it_was(what: str) -> None:
    assert 0 < len(rows(what)) <= LONGEST[what]


@pytest.mark.parametrize("what", LONGEST)
def test_every_file_of_a_path_knows_the_types_that_it_hands_over(what: str) -> None:
    unknown = [
        (file.name, name)
        for file, handed_over, _ in rows(what)
        for name in re.findall(r"`(\w+)`", handed_over)
        if not re.search(rf"\b{name}\b", file.read_text())
    ]
    assert unknown == []


@pytest.mark.parametrize("what", LONGEST)
def test_what_a_file_of_a_path_asks_is_on_no_path_and_is_asked(what: str) -> None:
    on_path = {file for file, _, _ in rows(what)}
    for file, _, asked in rows(what):
        for other in asked:
            assert (ROOT / other).is_file()
            assert ROOT / other not in on_path
            assert re.search(rf"\b{Path(other).stem}\b", file.read_text()), (file.name, other)
