"""What a release fixes: its version, the migrations that it brings, and its part of the changelog."""

import re
from itertools import groupby
from pathlib import Path

import pytest
from alembic.script import Script, ScriptDirectory

from app import __version__

ROOT = Path(__file__).resolve().parents[2]
MIGRATIONS = [*ScriptDirectory(str(ROOT / "migrations")).walk_revisions()][::-1]
SECTION = re.compile(r"^## \[(?P<name>[^]]+)\](?P<text>.*?)(?=^## \[|\Z)", re.MULTILINE | re.DOTALL)
CHANGELOG = {found["name"]: found["text"] for found in SECTION.finditer((ROOT / "CHANGELOG.md").read_text())}


def release_of(migration: Script) -> str:
    return str(getattr(migration.module, "release", "none"))


def numbers(version: str) -> tuple[int, ...]:
    """(0, 4, 0) for 0.4.0, and for 0.4.0.dev0 on the way to it."""
    return tuple(int(part) for part in version.removesuffix(".dev0").split("."))


@pytest.mark.parametrize("migration", MIGRATIONS, ids=lambda migration: migration.revision)
def test_every_migration_names_a_release_that_is_not_newer_than_the_program(migration: Script) -> None:
    assert re.fullmatch(r"\d+\.\d+\.\d+", release_of(migration))
    assert numbers(release_of(migration)) <= numbers(__version__)


def test_no_migration_belongs_to_an_earlier_release_than_the_one_before_it() -> None:
    releases = [numbers(release_of(migration)) for migration in MIGRATIONS]
    assert releases == sorted(releases)


def test_the_changelog_begins_with_this_release_or_with_what_is_not_released() -> None:
    assert next(iter(CHANGELOG)) == ("Unreleased" if __version__.endswith(".dev0") else __version__)


def test_the_changelog_names_the_revisions_that_each_release_brings_to_a_database() -> None:
    """So that none is added to a release that is out. The first release had no database to migrate."""
    brought = {
        release: [migration.revision for migration in group] for release, group in groupby(MIGRATIONS, release_of)
    }
    for release, revisions in list(brought.items())[1:]:
        named = f"revisions {revisions[0]} to {revisions[-1]}" if len(revisions) > 1 else f"revision {revisions[0]}"
        assert f"({named})" in CHANGELOG[release if release in CHANGELOG else "Unreleased"]
