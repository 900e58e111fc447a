"""Reports as PDF, printed by Chromium if it is installed, in a separate process without network access."""

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

from app.common.errors import UnavailableError

PRINTERS: Final = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
TIMEOUT_S: Final = 60.0
MAX_CONCURRENT: Final = 2
_FLAGS: Final = (Path(__file__).parent / "chromium_flags.txt").read_text("ascii").splitlines()
_places = threading.BoundedSemaphore(MAX_CONCURRENT)
_log = structlog.get_logger(__name__)


def print_pdf(page: Callable[[], str]) -> bytes:
    """Print the HTML returned by `page` as PDF; `page` is called only once a browser and a free slot are available.

    Raises UnavailableError if there is no browser, all slots are in use, or printing fails; and whatever `page` raises.
    """
    browser = next(filter(None, map(shutil.which, PRINTERS)), None)
    if browser is None:
        raise UnavailableError(
            "Chromium is not installed on this server; PDF reports need it.",
            hint="Open the HTML report and print it from your browser (Save as PDF); or install Chromium on the "
            "computer that runs Gainline.",
        )
    if not _places.acquire(blocking=False):
        raise UnavailableError(
            f"{MAX_CONCURRENT} reports are already being printed.",
            hint="Try again in a few seconds, or use the HTML report.",
        )
    try:
        with tempfile.TemporaryDirectory(prefix="gainline-print-", ignore_cleanup_errors=True) as folder:
            return _printed(browser, page(), Path(folder))
    finally:
        _places.release()


def _printed(browser: str, html: str, folder: Path) -> bytes:
    page, out = folder / "report.html", folder / "report.pdf"
    page.write_text(html, encoding="utf-8")
    # As root, Chromium starts only without its sandbox; it opens only our own file, which has its own security policy.
    flags = [*_FLAGS, *(["--no-sandbox"] if os.geteuid() == 0 else []), f"--user-data-dir={folder / 'profile'}"]
    command = [browser, *flags, f"--print-to-pdf={out}", page.as_uri()]
    try:
        code, log_text = _run(command)
    except subprocess.TimeoutExpired as error:
        raise _failed(f"did not finish within {TIMEOUT_S:g} s") from error
    except OSError as error:
        raise _failed(f"could not be started: {error.strerror or error}") from error
    if code != 0 or not out.is_file():
        _log.error("printing failed", code=code, output=log_text[-2000:])
        raise _failed("ended without a PDF; see its output in the server's log")
    return out.read_bytes()


def _run(command: list[str]) -> tuple[int, str]:
    """Return the exit code and the error output of a command.

    It has its own process group, so that its children end with it on a time-out or if the caller is interrupted. Raises
    TimeoutExpired and OSError.
    """
    with subprocess.Popen(  # noqa: S603  # found in PATH
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace", process_group=0
    ) as browser:
        try:
            _, log_text = browser.communicate(timeout=TIMEOUT_S)
        except BaseException:
            os.killpg(browser.pid, signal.SIGKILL)
            raise
    return browser.returncode, log_text


def _failed(how: str) -> UnavailableError:
    return UnavailableError(
        f"The browser that prints reports {how}.",
        hint="Open the HTML report and print it from your own browser (Save as PDF).",
    )
