"""A page is added to the dashboard as CONTRIBUTING.md says, which is then built and opened."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server, served
from tests.recipes.additions import line
from tests.recipes.test_recipes import recipes_told

ROOT: Final = Path(__file__).resolve().parents[2]
PAGE: Final = ROOT / "tests" / "recipes" / "page" / "AboutPage.tsx"
COPIED: Final = ("index.html", "package.json", "public", "src", "tsconfig.json", "vite.config.ts")
CHANGES: Final = (
    line("pages.ts", 'export { AboutPage } from "./features/settings/AboutPage";', before="export { FlightPage"),
    line("app.tsx", 'const AboutPage = lazyPage("AboutPage");', before="const ComparePage"),
    line("app.tsx", '        <Route path="/about" component={AboutPage} />', before='        <Route path="/settings"'),
    line("frame/MainNav.tsx", '  { to: "/about", title: "About", inRow: false },', before='  { to: "/settings",'),
)


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """One that serves the dashboard with the page in it."""
    frontend = tmp_path / "frontend"
    frontend.mkdir()
    for name in COPIED:
        place = ROOT / "frontend" / name
        (shutil.copytree if place.is_dir() else shutil.copy)(place, frontend / name)
    (frontend / "node_modules").symlink_to(ROOT / "frontend" / "node_modules")
    shutil.copy(PAGE, frontend / "src/features/settings")
    for change in CHANGES:
        file = frontend / "src" / change.module
        file.write_text(change.applied(file.read_text()))
    for command in (["tsc", "--noEmit"], ["vite", "build"]):
        done = subprocess.run(command, cwd=frontend, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    monkeypatch.setenv("GAINLINE_UI_DIR", str(frontend / "dist"))
    with served(tmp_path / "data") as running:
        yield running


@pytest.mark.browser
@pytest.mark.complete
def test_a_page_of_one_file_and_four_lines_is_in_the_menu_and_opens(server: Server, open_dashboard: Opener) -> None:
    dashboard = open_dashboard(server.url)
    dashboard.open("/")
    dashboard.button("More pages").click()
    dashboard.page.get_by_role("link", name="About").click()
    expect(dashboard.page.get_by_role("heading", name="About")).to_be_visible()
    expect(dashboard.page).to_have_title("About · Gainline")


def test_the_recipe_names_every_file_that_is_changed() -> None:
    told = recipes_told()["page"]
    assert [change.module for change in CHANGES if change.module not in told] == []
