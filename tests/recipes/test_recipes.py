"""Each part that CONTRIBUTING.md says how to add is added as it says, in a process that ends with it, and used."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from tests.recipes.run import RECIPES

ROOT: Final = Path(__file__).resolve().parents[2]
ALONE: Final = [name for name, recipe in RECIPES.items() if not recipe.given]
"""Recipes of which none changes what another one does: they share a process, as starting one takes longest."""
BUILT_ON_OTHERS: Final = [name for name, recipe in RECIPES.items() if recipe.given]


@pytest.mark.complete
@pytest.mark.parametrize("recipes", [ALONE, BUILT_ON_OTHERS], ids=" ".join)
def test_what_is_added_by_the_recipes_works(recipes: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.recipes.run", *recipes],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def recipes_told() -> dict[str, str]:
    """The recipes of CONTRIBUTING.md, by their names."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    told = text[text.index("\n## How to add\n") : text.index("\n## Glossary\n")]
    _, *parts = re.split(r"^\*\*An? ([^*]+)\*\*\n", told, flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_every_recipe_is_tested_and_names_the_files_that_the_test_changes() -> None:
    told = recipes_told()
    assert {name.replace(" ", "_") for name in told} == {*RECIPES, "page"}
    for name, text in told.items():
        recipe = RECIPES.get(name.replace(" ", "_"))
        changed = {change.module.replace(".", "/") for change in recipe.changes} if recipe else set()
        assert [path for path in changed if path not in text] == [], name
