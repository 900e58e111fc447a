"""A real server, a real Chromium, and the dashboard between them."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TypeVar
from urllib.parse import urlsplit

import httpx2
import pytest
from playwright.sync_api import Browser, BrowserContext, Error, Page, expect, sync_playwright

from tests.e2e.dashboard import TABLET, Dashboard, Theme, Viewport
from tests.e2e.states import States
from tests.unlocking import new_link
from tests.waiting import Waits, wait_for

HERE = Path(__file__).parent
BUILT = HERE.parents[1] / "frontend" / "dist" / "index.html"
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync",
         "--js-flags=--no-opt --no-maglev"]  # fmt: skip
"""A page lives too briefly for its scripts to be worth optimising: that takes more than it saves."""
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


EVERYDAY = {
    "test_flight_day.py::test_a_day_from_the_wizard_to_the_report",
    "test_pages.py::test_the_ui_stays_light_before_its_charts",
    "test_pages.py::test_every_route_of_the_dashboard_is_among_these_pages",
}
"""What `./dev test` runs of the browser tests; all others belong to the complete ring."""
DATA_DIRS: dict[str, Path] = {}
"""Of the servers that were started, by address."""
T = TypeVar("T")


class SharedResources:
    """What browser tests share: begun when the first of them asks for it, ended when this process goes on to a test of
    another kind. Playwright's event loop, while it runs, would be in the way of other tests' asyncio.run."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._begun: dict[str, object] = {}

    def get(self, name: str, kind: type[T], begin: Callable[[], AbstractContextManager[T]]) -> T:
        if name not in self._begun:
            self._begun[name] = self._stack.enter_context(begin())
        found = self._begun[name]
        assert isinstance(found, kind)
        return found

    def begun(self, name: str, kind: type[T]) -> T | None:
        found = self._begun.get(name)
        return found if isinstance(found, kind) else None

    def end(self) -> None:
        self._begun.clear()
        self._stack.close()


STARTED = SharedResources()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.browser)
            if f"{item.path.name}::{getattr(item, 'originalname', item.name)}" not in EVERYDAY:
                item.add_marker(pytest.mark.complete)
            # What a module's tests share takes as long as all its campaigns.
            item.add_marker(pytest.mark.timeout(func_only=True))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Iterator[None]:
    """After the fixtures of this test."""
    try:
        yield
    finally:
        if nextitem is None or HERE not in nextitem.path.parents:
            STARTED.end()


@pytest.fixture(scope="session")
def chromium() -> str:
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium found; install one (Debian: apt-get install chromium) to run the browser tests")
    return found


@contextmanager
def launched(chromium: str) -> Iterator[Browser]:
    expect.set_options(timeout=1000 * Waits.at_most_s)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def browser(chromium: str) -> Browser:
    """One for all browser tests of this process."""
    return STARTED.get("browser", Browser, lambda: launched(chromium))


class Server:
    """`gainline serve` in a separate process."""

    def __init__(self, data_dir: Path, port: int = 0, *options: str) -> None:
        self.data_dir = data_dir
        self._port = port
        self._options = options
        self._process: subprocess.Popen[bytes] | None = None
        self.url = ""

    def start(self) -> None:
        assert BUILT.is_file(), "the UI is not built; run ./dev ui"
        gainline = Path(sys.executable).with_name("gainline")
        # Not a pipe: one that nobody reads is full one day, and then the server waits for ever to say something.
        said = self.data_dir.with_suffix(".log")
        with said.open("wb") as log:
            self._process = subprocess.Popen(
                [gainline, "serve", "--port", str(self._port), "--data-dir", self.data_dir, *self._options],
                stdout=log, stderr=subprocess.STDOUT)  # fmt: skip
        while (found := re.search(r"http://\S+:\d+", said.read_text())) is None:
            assert self._process.poll() is None, f"the server did not start:\n{said.read_text()}"
            time.sleep(0.05)
        self.url = found.group()
        self._port = urlsplit(self.url).port or 0
        DATA_DIRS[self.url] = self.data_dir
        if "--no-worker" not in self._options:
            wait_for("the worker", self._works)  # what is asked for before is withdrawn

    def _works(self) -> bool:
        return bool(httpx2.get(f"{self.url}/api/health", timeout=Waits.at_most_s).json()["worker"] == "running")

    @property
    def pid(self) -> int:
        assert self._process is not None, "the server is not running"
        return self._process.pid

    def worker_pid(self) -> int:
        """The worker's process, as its own lock tells."""
        pid: int = json.loads((self.data_dir / "worker.lock").read_text())["pid"]
        return pid

    def stop(self) -> None:
        if self._process is not None:
            self._process.send_signal(signal.SIGTERM)
            self._process.wait(timeout=Waits.at_most_s)
            self._process = None


@contextmanager
def served(data_dir: Path, port: int = 0, *options: str) -> Iterator[Server]:
    server = Server(data_dir, port, *options)
    try:
        server.start()
        yield server
    finally:
        server.stop()


@contextmanager
def written(server: Server) -> Iterator[States]:
    states = States(server.data_dir)
    yield states
    states.close()


@pytest.fixture(scope="module")
def shared_server(tmp_path_factory: pytest.TempPathFactory) -> Server:
    """One server for all tests of this process that neither stop it nor set it up otherwise."""
    return STARTED.get("server", Server, lambda: served(tmp_path_factory.mktemp("shared") / "data"))


@pytest.fixture(scope="module")
def states(shared_server: Server) -> States:
    """The contents of the shared server's database."""
    return STARTED.get("states", States, lambda: written(shared_server))


@pytest.fixture
def empty_server(shared_server: Server, states: States) -> Server:
    """The shared server as with a new data folder. Not for a module that shares campaigns between its tests."""
    states.clear()
    return shared_server


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    """A server that a test may stop."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with served(tmp_path / "data", port) as server:
        yield server


Opener = Callable[..., Dashboard]


class TabPool:
    """The tabs that tests take turns in. One that has shown the program before has it compiled already, and shows it in
    a third of the time that a new one takes."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._contexts: dict[str, BrowserContext] = {}
        self._free: dict[str, list[Page]] = {}
        self.wrong: list[str] = []

    def take(self, url: str) -> Page:
        """As new: at no page of the program, nothing in the browser's store."""
        if url not in self._contexts:
            self._contexts[url] = new_context(self._browser, url)
        if free := self._free.setdefault(url, []):
            page = free.pop()
            page.bring_to_front()  # one behind others has less of the processor
            return page
        page = self._contexts[url].new_page()
        watch(page, url, self.wrong)
        return page

    def give_back(self, url: str, page: Page) -> None:
        """Leave the program, and with it its connections to the server. What was opened beside it is closed, and so is
        all of it where a test has left it in a state that there is no way back from."""
        context = self._contexts.get(url)
        if context is None:
            return
        try:
            page.unroute_all(behavior="ignoreErrors")
            page.goto("/api/health")
            page.evaluate("localStorage.clear(); sessionStorage.clear()")
            page.mouse.move(0, 0)
            self._free[url].append(page)
            for other in context.pages:
                if other.opener() is not None:
                    other.close()
        except Error:
            self._free.pop(url, None)
            self._contexts.pop(url).close()


def new_context(browser: Browser, url: str, *, unlocked: bool = True) -> BrowserContext:
    """A browser profile of its own; whoever sits before it has opened a link of `gainline unlock`."""
    context = browser.new_context(base_url=url, viewport=TABLET, accept_downloads=True, reduced_motion="reduce")
    context.set_default_timeout(1000 * Waits.at_most_s)
    if unlocked and url in DATA_DIRS:
        opened = context.request.get(new_link(DATA_DIRS[url]), max_redirects=0)
        assert opened.status == 303, opened.text()
    return context


@pytest.fixture(scope="module")
def tabs(browser: Browser) -> TabPool:
    return STARTED.get("tabs", TabPool, lambda: nullcontext(TabPool(browser)))


@pytest.fixture
def open_dashboard(browser: Browser, tabs: TabPool) -> Iterator[Opener]:
    """Opens a dashboard in a tab whose store is empty; afterwards nothing must have gone wrong in any of them.

    Without `unlocked` nobody has opened a link of `gainline unlock` in it. With `alone` the tab has a browser profile
    of its own: for tests that put scripts or a clock of their own into their pages, take the browser's network away, or
    look at what it fetches. So has one of a server of one's own.
    """
    tabs.wrong.clear()
    taken: list[tuple[str, Page]] = []
    with ExitStack() as stack:

        def own(url: str, *, unlocked: bool) -> Page:
            context = new_context(browser, url, unlocked=unlocked)
            stack.callback(context.close)
            page = context.new_page()
            watch(page, url, tabs.wrong)
            return page

        def open_one(
            url: str,
            *,
            theme: Theme = "light",
            viewport: Viewport = TABLET,
            alone: bool = False,
            unlocked: bool = True,
        ) -> Dashboard:
            shared = STARTED.begun("server", Server)
            if alone or not unlocked or shared is None or url != shared.url:
                page = own(url, unlocked=unlocked)
            else:
                page = tabs.take(url)
                taken.append((url, page))
            page.emulate_media(color_scheme=theme)
            page.set_viewport_size(viewport)
            return Dashboard(page, url)

        yield open_one
    for url, page in taken:
        tabs.give_back(url, page)
    assert tabs.wrong == []


def watch(page: Page, url: str, wrong: list[str]) -> None:
    """Note scripts that failed and requests to any other host."""
    own = urlsplit(url).netloc
    page.on("pageerror", lambda error: wrong.append(f"script error: {error}"))

    def look(address: str) -> None:
        parts = urlsplit(address)
        if parts.scheme in {"http", "https", "ws", "wss"} and parts.netloc != own:
            wrong.append(f"request to another host: {address}")

    def note(text: str) -> None:
        if "Content Security Policy" in text or "Warning:" in text:
            wrong.append(f"console: {text}")

    page.on("console", lambda message: note(message.text))
    page.on("request", lambda request: look(request.url))
    page.on("websocket", lambda socket: look(socket.url))


@pytest.fixture
def dashboard(open_dashboard: Opener, shared_server: Server) -> Dashboard:
    return open_dashboard(shared_server.url)
