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
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx2
import pytest
from playwright.sync_api import Browser, Page, Playwright, expect, sync_playwright

from tests.e2e.dashboard import TABLET, Dashboard, Theme, Viewport
from tests.runtime.processes import wait_for

HERE = Path(__file__).parent
BUILT = HERE.parents[1] / "frontend" / "dist" / "index.html"
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync"]  # fmt: skip
PATIENCE_MS = 20_000
"""On a machine that has other things to do as well."""
ENDS_WITHIN_S = 90
"""Longer than a server waits for its worker."""
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.browser)
            # What a module's tests share takes as long as all its campaigns, and has limits of its own.
            item.add_marker(pytest.mark.timeout(180, func_only=True))


@pytest.fixture(scope="session")
def chromium() -> str:
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium found; install one (Debian: apt-get install chromium) to run the browser tests")
    return found


@pytest.fixture(scope="module")
def playwright() -> Iterator[Playwright]:
    """Ended with its module: while it runs, its event loop would be in the way of other tests' asyncio.run."""
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as running:
        yield running


@pytest.fixture(scope="module")
def browser(playwright: Playwright, chromium: str) -> Iterator[Browser]:
    running = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
    yield running
    running.close()


class Server:
    """`gainline serve` in a process of its own."""

    def __init__(self, data_dir: Path, port: int = 0) -> None:
        self.data_dir = data_dir
        self._port = port
        self._process: subprocess.Popen[bytes] | None = None
        self.url = ""

    def start(self) -> None:
        assert BUILT.is_file(), "the UI is not built; run ./dev ui"
        gainline = Path(sys.executable).with_name("gainline")
        # Not a pipe: one that nobody reads is full one day, and then the server waits for ever to say something.
        said = self.data_dir.with_suffix(".log")
        with said.open("wb") as log:
            self._process = subprocess.Popen(
                [gainline, "serve", "--port", str(self._port), "--data-dir", self.data_dir],
                stdout=log, stderr=subprocess.STDOUT)  # fmt: skip
        while (found := re.search(r"http://\S+:\d+", said.read_text())) is None:
            assert self._process.poll() is None, f"the server did not start:\n{said.read_text()}"
            time.sleep(0.05)
        self.url = found.group()
        self._port = urlsplit(self.url).port or 0
        wait_for("the worker", self._works)  # what is asked for before is withdrawn

    def _works(self) -> bool:
        return bool(httpx2.get(f"{self.url}/api/health").json()["worker"] == "running")

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
            self._process.wait(timeout=ENDS_WITHIN_S)
            self._process = None


@contextmanager
def served(data_dir: Path, port: int = 0) -> Iterator[Server]:
    server = Server(data_dir, port)
    try:
        server.start()
        yield server
    finally:
        server.stop()


@pytest.fixture(scope="session")
def shared_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server for all tests that do not mind each other's campaigns."""
    with served(tmp_path_factory.mktemp("shared")) as server:
        yield server


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    """A server with an empty database."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with served(tmp_path / "data", port) as server:
        yield server


Opener = Callable[..., Dashboard]


@pytest.fixture
def open_dashboard(browser: Browser) -> Iterator[Opener]:
    """Opens a dashboard in a browser profile of its own; afterwards nothing must have gone wrong in any of them."""
    wrong: list[str] = []
    with ExitStack() as stack:

        def open_one(url: str, *, theme: Theme = "light", viewport: Viewport = TABLET) -> Dashboard:
            context = browser.new_context(base_url=url, color_scheme=theme, viewport=viewport, accept_downloads=True)
            stack.callback(context.close)
            page = context.new_page()
            page.set_default_timeout(PATIENCE_MS)
            _watch(page, url, wrong)
            return Dashboard(page, url)

        yield open_one
    assert wrong == []


def _watch(page: Page, url: str, wrong: list[str]) -> None:
    """Note scripts that failed and requests to any other host."""
    own = urlsplit(url).netloc
    page.on("pageerror", lambda error: wrong.append(f"script error: {error}"))

    def look(address: str) -> None:
        parts = urlsplit(address)
        if parts.scheme in {"http", "https", "ws", "wss"} and parts.netloc != own:
            wrong.append(f"request to another host: {address}")

    def heed(text: str) -> None:
        if "Content Security Policy" in text or "Warning:" in text:
            wrong.append(f"console: {text}")

    page.on("console", lambda message: heed(message.text))
    page.on("request", lambda request: look(request.url))
    page.on("websocket", lambda socket: look(socket.url))


@pytest.fixture
def dashboard(open_dashboard: Opener, shared_server: Server) -> Dashboard:
    return open_dashboard(shared_server.url)
