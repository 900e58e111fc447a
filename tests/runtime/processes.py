"""Gainline's own processes, started as a person starts them, and killed as fate does."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import httpx2

from tests.waiting import Waits, wait_for

LIFTED_M = 0.1
ENDED = {"valid", "aborted", "invalid", "cancelled"}


def environment(**more: str) -> dict[str, str]:
    """This process's, without its own settings."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("GAINLINE_")}
    return {**kept, **more}


def started_by(pid: int) -> list[int]:
    """The processes whose parent it is."""
    return [int(child) for task in Path(f"/proc/{pid}/task").glob("*/children") for child in task.read_text().split()]


def fork_server(worker: int) -> int:
    """From which a worker's processes are forked."""
    commands = {child: Path(f"/proc/{child}/cmdline").read_bytes() for child in started_by(worker)}
    return next(child for child, command in commands.items() if b"multiprocessing.forkserver" in command)


def children(worker: int) -> list[int]:
    """The processes that fly and compute for a worker."""
    return started_by(fork_server(worker))


def is_alive(pid: int) -> bool:
    """Whether that process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


class Serving:
    """A `gainline serve` that has said it is ready."""

    def __init__(self, data_dir: Path, *options: str, **more: str) -> None:
        self.data_dir = data_dir
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the processes that write into it
        self.process = subprocess.Popen(
            [sys.executable, "-m", "app.cli", "serve", "--port", "0", "--data-dir", str(data_dir), *options],
            env=environment(**more),
            text=True,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )
        assert self.process.stdout is not None
        self.said: list[str] = []
        while "ready at" not in (line := self.process.stdout.readline()):
            assert line, self.logged()
            self.said.append(line)
        self.url = line.rpartition(" ")[2].strip()
        self._unlocked = False
        self.api = httpx2.Client(base_url=f"{self.url}/api", timeout=Waits.at_most_s)

    def unlock(self) -> None:
        """Open the link that was printed at the start, as a person does in the browser."""
        if self._unlocked:
            return
        assert self.process.stdout is not None
        while (link := re.search(r"http://\S+/unlock\?token=\S+", self.process.stdout.readline())) is None:
            assert self.process.poll() is None, self.logged()
        assert self.api.get(link.group()).status_code == 303
        self._unlocked = True

    def logged(self) -> str:
        """What the server and its worker wrote to standard error, until `stop`."""
        return (
            self._log if self._errors.closed else os.pread(self._errors.fileno(), 2**24, 0).decode()
        )  # not moving the position that it is written at

    def worker_pid(self) -> int:
        """Of the worker that works now."""
        wait_for("the worker", lambda: self.get("/health")["worker"] == "running")
        pid: int = json.loads((self.data_dir / "worker.lock").read_text())["pid"]
        return pid

    def get(self, path: str) -> Any:
        answer = self.api.get(path)
        answer.raise_for_status()
        return answer.json()

    def post(self, path: str, body: object = None) -> Any:
        answer = self.api.post(path, json=body)
        assert answer.is_success, answer.text
        return answer.json()

    def campaign(self, *, kind: str = "twin", max_flights: int = 7, options: dict[str, float] | None = None) -> int:
        """A new campaign whose first proposal is there."""
        created = self.post(
            "/campaigns",
            {
                "name": "Takeoff",
                "vehicle": {"kind": kind, "options": options or {}},
                "definition": {"stop": {"kind": "budget", "max_flights": max_flights}},
            },
        )
        self.proposal(created["id"])
        identity: int = created["id"]
        return identity

    def proposal(self, campaign_id: int) -> Any:
        """The proposal that holds now."""

        def ready() -> Any:
            found = self.get(f"/campaigns/{campaign_id}/proposal")
            assert found["state"] != "failed", found
            return found["proposal"] if found["state"] == "ready" and not found["proposal"]["stale"] else None

        return wait_for("a proposal", ready)

    def fly(self, campaign_id: int, *, speed: float | None = None) -> int:
        """Ask for the flight of the proposal."""
        trial = self.post(
            f"/campaigns/{campaign_id}/trials",
            {"proposal_id": self.proposal(campaign_id)["id"], "fly": {"speed": speed}},
        )
        identity: int = trial["id"]
        return identity

    def trial(self, trial_id: int, *states: str) -> Any:
        """The trial, once it is in one of the states; one that has ended otherwise fails with its reason."""

        def there() -> Any:
            found = self.get(f"/trials/{trial_id}")
            if found["state"] in states:
                return found
            assert found["state"] not in ENDED, f"trial {trial_id} is {found['state']}: {found['reason']}"
            return None

        return wait_for(f"trial {trial_id} to be {' or '.join(states)}", there)

    def stop(self, number: signal.Signals = signal.SIGTERM) -> int:
        """Ask it to end; the exit code."""
        self.api.close()
        if self.process.poll() is None:
            self.process.send_signal(number)
        code = self.process.wait(Waits.at_most_s)
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._log = self.logged()
        self._errors.close()
        return code

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


@contextmanager
def stream(url: str, last_event_id: str | None = None, *, since_s: float = 0.0) -> Iterator["Stream"]:
    """An open event stream."""
    headers = {} if last_event_id is None else {"Last-Event-ID": last_event_id}
    with httpx2.stream(
        "GET", f"{url}/api/events", params={"since_s": since_s}, headers=headers, timeout=Waits.at_most_s
    ) as response:
        response.raise_for_status()
        yield Stream(response)


class Stream:
    """Events one after the other: name, id, data."""

    def __init__(self, response: httpx2.Response) -> None:
        self._lines = response.iter_lines()

    def __iter__(self) -> Iterator[tuple[str, str | None, Any]]:
        fields: dict[str, str] = {}
        for line in self._lines:
            if line:
                name, _, value = line.partition(": ")
                fields[name] = value
            elif "event" in fields:
                yield fields["event"], fields.get("id"), json.loads(fields["data"])
                fields = {}
            else:
                fields = {}


def in_the_air(serving: Serving, campaign_id: int, *, speed: float) -> int:
    """A trial that has lifted off."""
    with stream(serving.url) as events:
        trial_id = serving.fly(campaign_id, speed=speed)
        for name, _, data in events:
            if name == "telemetry" and data["samples"][-1][1] > LIFTED_M:
                return trial_id
    raise AssertionError("the stream ended")
