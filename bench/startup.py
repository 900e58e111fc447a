"""Start-up times: imports in processor time, the dashboard and the first flight in wall-clock time.

    ./dev exec python -m bench.startup [--rounds 3] [--clone]

Processor time is the user and system time of a fresh interpreter, the least of several runs. Wall-clock time is that of
`./dev up` on a data folder that it has served before, from the command to the answer of `GET /`, and to the first
telemetry above the ground of a campaign that is created, proposed and flown as soon as the page is there. The least of
the rounds counts, because other programs on the machine slow the start down.

With `--clone` also the first `./dev up` of a fresh clone, to the page: everything is installed and built, from what
earlier set-ups have left in the caches of pip, uv and npm, so that hardly anything is downloaded.

The limits are those of a machine that needs `REFERENCE_S` of processor time for `REFERENCE`. They are raised in
proportion where that takes longer, measured at about the same time. Prints the figures beside their limits; exits with
1 if one is exceeded.
"""

import argparse
import contextlib
import json
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

import httpx2

T = TypeVar("T")

ROOT: Final = Path(__file__).parents[1]
LOOPBACK: Final = "127.0.0.1"
IMPORT_S: Final = 0.8
HELP_S: Final = 0.25
PAGE_S: Final = 2.0
FLIGHT_S: Final = 4.0
CLONE_S: Final = 20.0
REFERENCE: Final = (sys.executable, "-c", "import fastapi, sqlalchemy.orm, uvicorn")
REFERENCE_S: Final = 0.45
"""On an EPYC at 2.6 GHz without other load."""
INTERPRETERS: Final = 7
PATIENCE_S: Final = 120.0
LOOK_EVERY_S: Final = 0.01
OFF_THE_GROUND_M: Final = 0.02


def processor_s(*commands: Sequence[str]) -> list[float]:
    """Return the least processor time of several runs of each command, s, run in turns with cached byte code."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    taken: list[list[float]] = [[] for _ in commands]
    for _ in range(INTERPRETERS):
        for command, seconds in zip(commands, taken, strict=True):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return [min(seconds) for seconds in taken]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


@contextlib.contextmanager
def up(folder: Path, checkout: Path = ROOT) -> Iterator[str]:
    """Run `./dev up` until the end of the block, and yield the address that it will serve."""
    port = free_port()
    with (folder / "said").open("w") as said:
        process = subprocess.Popen(
            [checkout / "dev", "up", "--port", str(port), "--data-dir", folder / "data"],
            stdout=said, stderr=said, start_new_session=True,
        )  # fmt: skip
        try:
            yield f"http://{LOOPBACK}:{port}"
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(PATIENCE_S)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # what still compiles, after the first start of a clone


def until(what: str, look: Callable[[], T | None]) -> T:
    """Wait until `look` returns something other than None, and return that."""
    deadline_s = time.monotonic() + PATIENCE_S
    while (found := look()) is None:
        assert time.monotonic() < deadline_s, f"timed out waiting for {what}"
        time.sleep(LOOK_EVERY_S)
    return found


def page(url: str) -> bytes | None:
    with contextlib.suppress(httpx2.ConnectError):
        answer = httpx2.get(url, timeout=PATIENCE_S)
        assert answer.is_success, "is the UI built? ./dev ui"
        return answer.content
    return None


def post(api: httpx2.Client, path: str, body: object) -> Any:
    answer = api.post(path, json=body)
    assert answer.is_success, answer.text
    return answer.json()


def lift_off(url: str) -> None:
    """Create a campaign, wait for its proposal, have it flown, and return once the vehicle is above the ground."""
    with httpx2.Client(base_url=f"{url}/api", timeout=PATIENCE_S) as api:
        campaign = post(api, "/campaigns", {"name": "First", "vehicle": {"kind": "jsbsim"}, "definition": {}})["id"]
        with api.stream("GET", "/events") as events:
            until("the worker", lambda: api.get("/health").json()["worker"] == "running" or None)
            until("the proposal", lambda: api.get(f"/campaigns/{campaign}").json()["state"] == "ready" or None)
            proposal = api.get(f"/campaigns/{campaign}/proposal").json()["proposal"]["id"]
            post(api, f"/campaigns/{campaign}/trials", {"proposal_id": proposal, "fly": {"speed": 10.0}})
            for line in events.iter_lines():
                if not line.startswith("data:") or "samples" not in (message := json.loads(line[5:])):
                    continue
                if any(sample[1] > OFF_THE_GROUND_M for sample in message["samples"]):
                    return
    raise AssertionError("The stream of events ended before the flight began.")


def start(folder: Path) -> tuple[float, float]:
    """Return the times from the command to the page and to the first flight, s."""
    begun_s = time.monotonic()
    with up(folder) as url:
        until("the page", lambda: page(url))
        page_s = time.monotonic() - begun_s
        lift_off(url)
        return page_s, time.monotonic() - begun_s


def start_of_clone(folder: Path) -> float:
    """Return the time from the first `./dev up` in a fresh clone to the page, s."""
    checkout = folder / "clone"
    subprocess.run(["git", "clone", "--quiet", ROOT, checkout], check=True)
    begun_s = time.monotonic()
    with up(folder, checkout) as url:
        until("the page", lambda: page(url))
        return time.monotonic() - begun_s


def slowness(reference_s: float) -> float:
    """Return how much slower imports are now than on the machine of the limits; at least 1."""
    return max(1.0, reference_s / REFERENCE_S)


def judge(what: str, seconds: float, limit_s: float, slowness: float) -> bool:
    """Print a figure and return whether it is above its limit."""
    print(f"{what}: {seconds:.2f} s (limit {limit_s:g} s × {slowness:.2f})")
    return seconds > limit_s * slowness


def main() -> int:
    arguments = argparse.ArgumentParser(prog="bench.startup")
    arguments.add_argument("--rounds", type=int, default=3, help="number of starts")
    arguments.add_argument("--clone", action="store_true", help="also the first start of a fresh clone")
    chosen = arguments.parse_args()
    gainline = str(Path(sys.executable).with_name("gainline"))
    reference_s, import_s, help_s = processor_s(
        REFERENCE, (sys.executable, "-c", "import app.main"), (gainline, "--help")
    )
    slow = slowness(reference_s)
    exceeded = judge("import app.main, processor time", import_s, IMPORT_S, slow)
    exceeded |= judge("gainline --help, processor time", help_s, HELP_S, slow)
    slow = slowness(*processor_s(REFERENCE))
    with tempfile.TemporaryDirectory() as folder:
        start(Path(folder))
        starts = [start(Path(folder)) for _ in range(chosen.rounds)]
    exceeded |= judge("./dev up to the page", min(page_s for page_s, _ in starts), PAGE_S, slow)
    exceeded |= judge("./dev up to the first flight", min(flight_s for _, flight_s in starts), FLIGHT_S, slow)
    if chosen.clone:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            exceeded |= judge("./dev up in a clone to the page", start_of_clone(Path(folder)), CLONE_S, slow)
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
    return int(exceeded)


if __name__ == "__main__":
    sys.exit(main())
