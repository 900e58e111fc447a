"""A page is added to the dashboard as CONTRIBUTING.md says, which is then built and opened."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Route, expect

from tests.e2e.conftest import Opener, Server
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
def dashboard_with_page(tmp_path: Path) -> Path:
    """The built dashboard with the page in it."""
    for name in COPIED:
        place = ROOT / "frontend" / name
        (shutil.copytree if place.is_dir() else shutil.copy)(place, tmp_path / name)
    (tmp_path / "node_modules").symlink_to(ROOT / "frontend" / "node_modules")
    shutil.copy(PAGE, tmp_path / "src/features/settings")
    for change in CHANGES:
        file = tmp_path / "src" / change.module
        file.write_text(change.applied(file.read_text()))
    # All types take four times as long, of which a wrong name in `pages.ts` or `app.tsx` shows when the page opens.
    checked = {
        "extends": "./tsconfig.json",
        "include": ["src/features/settings/AboutPage.tsx", "src/frame/MainNav.tsx"],
    }
    (tmp_path / "tsconfig.page.json").write_text(json.dumps(checked))
    for command in (["tsc", "--noEmit", "-p", "tsconfig.page.json"], ["vite", "build"]):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return tmp_path / "dist"


@pytest.mark.browser
@pytest.mark.complete
def test_a_page_of_one_file_and_four_lines_is_in_the_menu_and_opens(
    dashboard_with_page: Path, shared_server: Server, open_dashboard: Opener
) -> None:
    dashboard = open_dashboard(shared_server.url, alone=True)

    def answer(route: Route) -> None:
        """In place of the server, which has the dashboard without the page."""
        asked = dashboard_with_page / urlsplit(route.request.url).path[1:]
        route.fulfill(path=asked if asked.is_file() else dashboard_with_page / "index.html")

    dashboard.page.route(lambda url: not urlsplit(url).path.startswith("/api/"), answer)
    dashboard.open("/")
    dashboard.button("More pages").click()
    dashboard.page.get_by_role("link", name="About").click()
    expect(dashboard.page.get_by_role("heading", name="About")).to_be_visible()
    expect(dashboard.page).to_have_title("About · Gainline")


def test_the_recipe_names_every_file_that_is_changed() -> None:
    told = recipes_told()["page"]
    assert [change.module for change in CHANGES if change.module not in told] == []
