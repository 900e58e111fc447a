"""A report as PDF, printed by a Chromium where there is one: a process of its own, without a network."""

import os
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

import structlog

from app.errors import UnavailableError

PRINTERS: Final = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
TIMEOUT_S: Final = 60.0
MAX_CONCURRENT: Final = 2
_FLAGS: Final = (
    "--headless",
    "--disable-gpu",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--no-pdf-header-footer",
    "--generate-pdf-document-outline",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--proxy-server=http://127.0.0.1:9",
    "--virtual-time-budget=20000",
)
_places = threading.BoundedSemaphore(MAX_CONCURRENT)
_log = structlog.get_logger(__name__)


def print_pdf(page: Callable[[], str]) -> bytes:
    """The HTML that `page` gives, as PDF; it is asked for once there is a browser and a place to print it. Raises
    UnavailableError when no browser is there, it is printing others already, or it fails; and what `page` raises."""
    browser = _browser()
    if not _places.acquire(blocking=False):
        raise UnavailableError(
            f"{MAX_CONCURRENT} reports are being printed already.", hint="Try again in a few seconds, or take the HTML."
        )
    try:
        with tempfile.TemporaryDirectory(prefix="gainline-print-", ignore_cleanup_errors=True) as folder:
            return _printed(browser, page(), Path(folder))
    finally:
        _places.release()


def _browser() -> str:
    found = next(filter(None, map(shutil.which, PRINTERS)), None)
    if found is None:
        raise UnavailableError(
            "There is no Chromium on this server, and that is what prints reports as PDF.",
            hint="Open the HTML report and print it from your browser (Save as PDF); or install Chromium where "
            "Gainline runs.",
        )
    return found


def _printed(browser: str, html: str, folder: Path) -> bytes:
    page, out = folder / "report.html", folder / "report.pdf"
    page.write_text(html, encoding="utf-8")
    # As root a Chromium starts only without its sandbox; what it opens is our own file, under a policy of its own.
    flags = [*_FLAGS, *(["--no-sandbox"] if os.geteuid() == 0 else []), f"--user-data-dir={folder / 'profile'}"]
    command = [browser, *flags, f"--print-to-pdf={out}", page.as_uri()]
    try:
        code, said = _run(command)
    except subprocess.TimeoutExpired as error:
        raise _failed(f"did not finish within {TIMEOUT_S:g} s") from error
    except OSError as error:
        raise _failed(f"could not be started: {error.strerror or error}") from error
    if code != 0 or not out.is_file():
        _log.error("printing failed", code=code, said=said[-2000:])
        raise _failed("ended without a PDF; the server's log has its last words")
    return out.read_bytes()


def _run(command: list[str]) -> tuple[int, str]:
    """How it ended, and what it said. It has a process group of its own: when it takes too long, or whoever waits is
    interrupted, its children end with it. Raises TimeoutExpired and OSError."""
    with subprocess.Popen(  # noqa: S603  # found in PATH
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace", process_group=0
    ) as browser:
        try:
            _, said = browser.communicate(timeout=TIMEOUT_S)
        except BaseException:
            os.killpg(browser.pid, signal.SIGKILL)
            raise
    return browser.returncode, said


def _failed(how: str) -> UnavailableError:
    return UnavailableError(
        f"The browser that prints reports {how}.",
        hint="Open the HTML report and print it from your own browser (Save as PDF).",
    )
