"""MAVProxy, an independent ground station, as a separate process that is typed to and read from."""

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.waiting import Waits


class MavProxy:
    """Waits at a port of this computer until a vehicle speaks. `folder` takes whatever it would leave behind."""

    def __init__(self, port: int, folder: Path, *, dialect: str, mavlink: int, modules: tuple[str, ...]) -> None:
        program = shutil.which("mavproxy.py")
        assert program is not None
        command = [
            *(sys.executable, "-u", program),
            f"--master=udpin:127.0.0.1:{port}",
            f"--mav{mavlink}0",
            f"--dialect={dialect}",
            "--no-state",
            f"--default-modules={','.join(modules)}",
        ]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=folder,
            env={**os.environ, "HOME": str(folder), "MAVLINK_DIALECT": dialect},
        )
        self._said = ""
        self._looked_at = 0
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._read)

    def __enter__(self) -> Self:
        self._reader.start()
        self.hears("Waiting for heartbeat")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def type(self, *lines: str) -> None:
        """As a person would at its prompt."""
        assert self._process.stdin is not None
        for line in lines:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()

    def hears(self, pattern: str) -> re.Match[str]:
        """The next of what it says that matches, whatever comes between. Raises AssertionError with all it said."""
        until_s = time.monotonic() + Waits.at_most_s
        with self._news:
            while (found := re.compile(pattern).search(self._said, self._looked_at)) is None:
                left_s = until_s - time.monotonic()
                assert left_s > 0.0, f"no {pattern!r} within {Waits.at_most_s:g} s, but:\n{self._said}"
                self._news.wait(left_s)
            self._looked_at = found.end()
        return found

    def _read(self) -> None:
        assert self._process.stdout is not None
        while text := os.read(self._process.stdout.fileno(), 65536).decode(errors="replace"):
            with self._news:
                self._said += text
                self._news.notify_all()
