"""The documents agree with the program."""

import re
import runpy
from pathlib import Path

import pytest

from app.campaigns.campaign_files import preset_names
from app.common.settings import Settings
from app.reproductions.registry import REPRODUCTIONS

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


@pytest.mark.parametrize("name", Settings.model_fields)
def test_every_setting_is_explained_to_the_operator(name: str) -> None:
    assert f"| `GAINLINE_{name.upper()}` |" in (ROOT / "docs/operations.md").read_text()


def test_no_setting_is_explained_that_does_not_exist() -> None:
    explained = re.findall(r"^\| `GAINLINE_([A-Z_]+)`", (ROOT / "docs/operations.md").read_text(), re.MULTILINE)
    assert {name.lower() for name in explained} == set(Settings.model_fields)


def test_every_command_of_dev_is_explained_to_contributors() -> None:
    commands = runpy.run_path(str(ROOT / "dev"), run_name="dev")["COMMANDS"]
    text = (ROOT / "CONTRIBUTING.md").read_text() + (ROOT / "README.md").read_text()
    assert [name for name in commands if f"./dev {name}" not in text] == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_between_documents_lead_somewhere(document: Path) -> None:
    links = re.findall(r"\]\((?!https?://|#|mailto:)([^)#]+)", document.read_text())
    assert [link for link in links if not (document.parent / link).exists()] == []


def test_every_test_that_shows_a_promise_is_there() -> None:
    shown = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", (ROOT / "docs/security.md").read_text())
    assert len(shown) > 20
    missing = [
        (file, name)
        for file, name in shown
        if not (ROOT / file).is_file() or (name and f"def {name}(" not in (ROOT / file).read_text())
    ]
    assert missing == []


def test_decision_records_are_numbered_without_gaps() -> None:
    numbers = sorted(int(path.name[:4]) for path in (ROOT / "docs/decisions").glob("[0-9]*.md"))
    assert numbers == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_file_that_a_document_names_is_there(document: Path) -> None:
    named = re.findall(r"`((?:app|bench|frontend/src|migrations|tests)/[\w./-]+)`", document.read_text())
    assert [name for name in named if "NAME" not in name and not (ROOT / name).exists()] == []


def test_the_table_of_the_papers_claims_leaves_nothing_out() -> None:
    """Sections 1 to 6, equations (1) to (8), steps 1 to 7, Tables 1 and 2, Figs. 1 to 12, footnotes 1 to 10."""
    text = (ROOT / "docs/paper.md").read_text()
    numbers = re.findall(r"\((\d[ab]?)\)", text)
    assert {"1", "2", "3", "4", "5", "6a", "6b", "7a", "7b", "8"} <= set(numbers)
    assert [step for step in range(1, 8) if f"| Step {step}:" not in text] == []
    sections = [
        "1",
        "2.1",
        "2.2",
        "3.1",
        "3.2",
        "3.2.1",
        "3.2.2",
        "3.2.3",
        "4",
        "4.1",
        "4.2.1",
        "4.2.2",
        "5.1.1",
        "5.1.2",
    ]
    sections += ["5.1.3", "5.2", "5.3"]
    assert [section for section in sections if not re.search(rf"^\| .*\b{re.escape(section)}\b", text, re.M)] == []
    assert [table for table in (1, 2) if f"| Table {table} " not in text] == []
    assert [figure for figure in range(1, 13) if not re.search(rf"Figs?\. {figure}\b", text)] == []


def test_every_reproduction_and_preset_that_the_table_names_is_there() -> None:
    text = (ROOT / "docs/paper.md").read_text()
    assert set(re.findall(r"`gainline reproduce (\w+)", text)) == set(REPRODUCTIONS)
    presets = set(re.findall(r"`gainline run ([\w-]+)", text))
    assert presets
    assert presets <= set(preset_names())
