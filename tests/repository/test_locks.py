"""The locked dependencies: complete, hashed, and free of addresses."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LOCKS = sorted((ROOT / "requirements").glob("*.txt"))
PINNED = re.compile(r"^([a-z0-9._-]+)==(\S+)", re.MULTILINE)


def pinned(name: str) -> dict[str, str]:
    return dict(PINNED.findall((ROOT / "requirements" / f"{name}.txt").read_text()))


def normalised(requirement: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[\[<>=! ;]", requirement, maxsplit=1)[0]).lower()


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_every_locked_package_carries_hashes(lock: Path) -> None:
    entries = re.split(r"\n(?=\S)", lock.read_text().strip())
    assert entries
    assert [entry.split()[0] for entry in entries if "--hash=sha256:" not in entry] == []


@pytest.mark.parametrize("lock", [*LOCKS, ROOT / "frontend/package-lock.json", ROOT / "frontend/.npmrc"], ids=str)
def test_locks_name_no_registry(lock: Path) -> None:
    text = lock.read_text()
    assert not re.search(r"--(extra-)?index-url|--find-links|\"resolved\"|^registry", text, re.MULTILINE)
    assert not re.search(r"(registry|pypi|pythonhosted)[a-z.]*\.(org|com|net)", text)


def test_the_lock_for_running_covers_every_dependency_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert {normalised(each) for each in project["dependencies"]} <= {normalised(name) for name in pinned("run")}


def test_what_benchmarks_compare_with_goes_with_the_versions_that_are_tested() -> None:
    tested, compared = pinned("dev"), pinned("bench")
    assert {"optuna", "bayesian-optimization"} <= set(compared)
    assert {name: version for name, version in compared.items() if tested.get(name, version) != version} == {}


def test_tests_run_with_the_versions_that_are_served() -> None:
    developing = pinned("dev")
    assert {name: developing[name] for name in pinned("run")} == pinned("run")
