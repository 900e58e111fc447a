"""Latency of an abort, from the request to the server to the first packet that executes it.

    ./dev exec python -m bench.abort [--seconds 25] [--idle 2000] [--files 1024]

Runs a real server, its worker and two simulated drones in separate processes. A tap between each vehicle and its link
forwards every packet and records when the operating system received it. 20 clients follow the event stream. Flights are
aborted over HTTP at random instants after the takeoff; in between, vehicles on the ground are sent Land. With `--idle`
a client keeps so many idle connections open and reopens those that the server closes, 200 a second; `--files` limits
the files that the server may have open. Prints the figures. Exits with 1 if the 99th percentile of either latency is
above 50 ms, a command was never sent, or a client received no telemetry.
"""

import argparse
import contextlib
import json
import multiprocessing
import os
import random
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

import httpx2
import numpy as np

from app.autopilots.dialects import PAPARAZZI, Message, number, text
from bench.link import LOOPBACK, SO_TIMESTAMPNS

LIMIT_S: Final = 0.05
CLIENTS: Final = 20
VEHICLES: Final = 2
DRONE_SPEED: Final = 5.0
SAFE_KP: Final = 283.0
TRIED: Final = {"kp": 300, "ki": 20, "kd": 90}
PATIENCE_S: Final = 60.0
SLOW_END_S: Final = 30.0
ENDS_WITHIN_S: Final = 90.0
"""Time-out of requests, longer than the server waits for its worker."""
ORDERS_EVERY_S: Final = 0.4
"""Interval between Land commands; the worker records each one, which takes longer than forwarding it."""
SEED: Final = 20261121
ABORTED: Final = {"strategy": "gradient", "stop": {"kind": "budget", "max_flights": 100}}
OPENED_EVERY_S: Final = 0.1
OPENED_AT_ONCE: Final = 20

Frames = list[tuple[int, bytes]]
"""Packets from the ground, with their times of arrival, ns since 1970."""


# ---- the tap


def tap(pipe: Connection) -> None:
    """Forward the packets of both sides, recording the ground's with their times; main function of a process."""
    with contextlib.ExitStack() as stack:
        ground, drone = (stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2))
        for side in (ground, drone):
            side.bind((LOOPBACK, 0))
        ground.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        pipe.send((ground.getsockname()[1], drone.getsockname()[1]))
        to_ground, to_drone = pipe.recv()
        frames: Frames = []
        while not pipe.poll():
            for side in select.select([ground, drone], [], [], 0.1)[0]:
                if side is drone:
                    ground.sendto(drone.recv(4096), (LOOPBACK, to_ground))
                    continue
                frame, ((_, _, stamp),), _, _ = ground.recvmsg(4096, 64)
                drone.sendto(frame, (LOOPBACK, to_drone))
                seconds, nanoseconds = struct.unpack("@qq", stamp)
                frames.append((seconds * 10**9 + nanoseconds, frame))
        pipe.recv()
        pipe.send(frames)


@dataclass(frozen=True, slots=True)
class Drone:
    """A simulated drone behind a tap."""

    address: str
    pipe: Connection

    def frames(self) -> Frames:
        """End the tap and return everything that the ground sent."""
        self.pipe.send("end")
        sent: Frames = self.pipe.recv()
        return sent


@contextlib.contextmanager
def tapped_drone() -> Iterator[Drone]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=tap, args=(theirs,), daemon=True)
    process.start()
    tap_for_ground, tap_for_drone = ours.recv()
    local, body = free_port(), free_port()
    ours.send((local, body))
    link = f"udp:{LOOPBACK}:{tap_for_drone}@{body}"
    command = ("sim-drone", "--vehicle", "twin", "--link", link, "--speed", str(DRONE_SPEED))
    with program(*command, until="Paparazzi"):
        yield Drone(f"udp:{LOOPBACK}:{tap_for_ground}@{local}", ours)
    process.join(1.0)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


@contextlib.contextmanager
def program(*arguments: str, until: str, files: int | None = None) -> Iterator[str]:
    """Run `gainline …` until the end of the block, and yield its output line that contains `until`.

    `files` limits the number of open files.
    """
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "app.cli", *arguments],
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=said,
            text=True,
            start_new_session=True,
        )
        if files is not None:
            resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (files, files))
        assert process.stdout is not None
        while until not in (line := process.stdout.readline()):
            assert line, f"gainline {arguments[0]} ended"
        try:
            yield line
        finally:
            process.send_signal(signal.SIGINT)
            asked_s = time.monotonic()
            try:
                process.wait(ENDS_WITHIN_S)
                if (took_s := time.monotonic() - asked_s) > SLOW_END_S:
                    print(f"gainline {arguments[0]} took {took_s:.0f} s to end:", file=sys.stderr)
                    said.seek(0)
                    print("".join(said.readlines()[-300:]), file=sys.stderr)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGUSR1)  # prints the stack of every thread
                time.sleep(1.0)
                said.seek(0)
                print("".join(said.readlines()[-300:]), file=sys.stderr)
                os.killpg(process.pid, signal.SIGKILL)
                raise


# ---- the clients


def watch(url: str, pipe: Connection) -> None:
    """Read CLIENTS event streams to the end; the main function of a process.

    Reports when all are open, and then how many telemetry messages the slowest has received.
    """
    counts = [0] * CLIENTS
    opened = threading.Barrier(CLIENTS + 1)
    done = threading.Event()

    def follow(index: int) -> None:
        with contextlib.suppress(httpx2.HTTPError), httpx2.stream("GET", f"{url}/api/events", timeout=5.0) as answer:
            opened.wait(PATIENCE_S)
            for line in answer.iter_lines():
                counts[index] += line == "event: telemetry"
                if done.is_set():
                    return

    for index in range(CLIENTS):
        threading.Thread(target=follow, args=(index,), daemon=True).start()
    opened.wait(PATIENCE_S)
    pipe.send("open")
    pipe.recv()
    pipe.send(min(counts))
    done.set()


def idle(address: tuple[str, int], connections: int, pipe: Connection) -> None:
    """Keep idle connections open until the pipe ends it; the main function of a process.

    Reports when all have been open once, and then how often one was closed.
    """
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(most, connections + 256), most))
    kept = [socket.create_connection(address) for _ in range(connections)]
    poll = select.poll()
    for each in kept:
        poll.register(each, select.POLLIN | select.POLLHUP | select.POLLERR)
    open_ones, closed = {each.fileno(): each for each in kept}, 0
    pipe.send("open")
    while not pipe.poll(OPENED_EVERY_S):
        for descriptor, _ in poll.poll(0):
            poll.unregister(descriptor)
            open_ones.pop(descriptor).close()
            closed += 1
        for _ in range(min(OPENED_AT_ONCE, connections - len(open_ones))):
            again = socket.create_connection(address)
            open_ones[again.fileno()] = again
            poll.register(again, select.POLLIN | select.POLLHUP | select.POLLERR)
    pipe.send(closed)


# ---- requests


@dataclass(slots=True)
class RequestTimes:
    """Times of the requests for each vehicle, ns since 1970."""

    aborts: list[tuple[int, int]] = field(default_factory=list)
    orders: list[tuple[int, int]] = field(default_factory=list)


class Operator:
    """One operator with one vehicle: flights until the time is over, each aborted soon after its takeoff."""

    def __init__(self, url: str, index: int, address: str, asked: RequestTimes) -> None:
        each_its_own = httpx2.Limits(max_keepalive_connections=0)
        self._api = httpx2.Client(base_url=f"{url}/api", timeout=PATIENCE_S, limits=each_its_own)
        self._index, self._asked = index, asked
        self._randomness = random.Random(SEED + index)
        options = {"address": address, "simulated": True, "clock_speed": DRONE_SPEED}
        self._vehicle = self._post("/vehicles", {"name": f"Drone {index}", "kind": "mavlink", "options": options})["id"]
        self._post(f"/vehicles/{self._vehicle}/connect")
        self._until(f"/vehicles/{self._vehicle}", lambda vehicle: vehicle["state"] == "ready")
        self._post(f"/vehicles/{self._vehicle}/check")  # sets the ground reference, which takes 10 s of the drone's
        self._until(f"/vehicles/{self._vehicle}", lambda vehicle: bool(vehicle["checks"]))
        chosen = {"kind": "mavlink", "id": self._vehicle}
        self._campaign = self._post("/campaigns", {"name": "Aborts", "vehicle": chosen, "definition": ABORTED})["id"]
        self._until(f"/campaigns/{self._campaign}", lambda campaign: campaign["state"] == "ready")

    def order_landings(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            time.sleep(self._randomness.uniform(0.5, 1.5) * ORDERS_EVERY_S)
            self._asked.orders.append((self._index, time.time_ns()))
            assert self._post(f"/vehicles/{self._vehicle}/land", {"reason": "bench"})["accepted"]

    def abort_flights(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            trial = self._post(f"/campaigns/{self._campaign}/trials", {"gains": TRIED})["id"]
            self._post(f"/trials/{trial}/fly")
            self._until(f"/trials/{trial}", lambda found: found["state"] == "flying")
            time.sleep(2.5 + self._randomness.uniform(0.0, 1.0))  # time for arming and the takeoff command
            self._asked.aborts.append((self._index, time.time_ns()))
            assert self._post(f"/trials/{trial}/abort", {"reason": "bench"})["accepted"]
            self._until(f"/vehicles/{self._vehicle}", lambda vehicle: vehicle["state"] == "ready")

    def _post(self, path: str, body: object = None) -> Any:
        answer = self._api.post(path, json=body)
        assert answer.is_success, answer.text
        return answer.json()

    def _until(self, path: str, fits: Callable[[Any], bool]) -> None:
        deadline_s = time.monotonic() + PATIENCE_S
        while not fits(found := self._api.get(path).json()):
            assert time.monotonic() < deadline_s, found
            time.sleep(0.1)


# ---- the figures


def delays_s(
    asked: list[tuple[int, int]], sent: Mapping[int, Frames], carries: Callable[[Message], bool]
) -> list[float]:
    """Return the delay from each request to the first packet that executes it; infinite if there is none within 2 s."""
    codec = PAPARAZZI.codec(system=1, component=1)
    wanted = {
        index: [at_ns for at_ns, frame in frames if any(carries(message) for message in codec.parse(frame))]
        for index, frames in sent.items()
    }
    found = []
    for index, asked_ns in asked:
        delay_s = min((at_ns - asked_ns for at_ns in wanted[index] if at_ns >= asked_ns), default=10**18) * 1e-9
        found.append(delay_s if delay_s < 2.0 else float("inf"))
    return found


def ends_a_flight(message: Message) -> bool:
    """Whether a packet writes the first safe gain, with which an abort begins."""
    return message.get_type() == "PARAM_SET" and (text(message, "param_id"), number(message, "param_value")) == (
        "gui_v_kp",
        SAFE_KP,
    )


def is_landing(message: Message) -> bool:
    return message.get_type() == "SCRIPT_ITEM"


def judge(what: str, delays: list[float]) -> bool:
    """Print the figures and return whether they are above the limit."""
    median_s, high_s = np.quantile(delays, [0.5, 0.99], method="higher") if delays else (np.inf, np.inf)
    print(
        f"{what}: {len(delays)}, p50 {median_s * 1e3:.1f} ms, p99 {high_s * 1e3:.1f} ms (limit {LIMIT_S * 1e3:.0f}), "
        f"max {max(delays, default=np.inf) * 1e3:.1f} ms"
    )
    return bool(high_s > LIMIT_S)


def together(work: list[Callable[[], None]]) -> None:
    threads = [threading.Thread(target=each) for each in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def main() -> int:
    arguments = argparse.ArgumentParser(prog="bench.abort")
    arguments.add_argument("--seconds", type=float, default=25.0, help="duration of the flights")
    arguments.add_argument("--idle", type=int, default=0, help="number of idle connections")
    arguments.add_argument("--files", type=int, help="number of files that the server may have open")
    chosen = arguments.parse_args()
    seconds = chosen.seconds
    asked = RequestTimes()
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        drones = [stack.enter_context(tapped_drone()) for _ in range(VEHICLES)]
        command = ("serve", "--port", "0", "--data-dir", str(folder))
        line = stack.enter_context(program(*command, until="ready at", files=chosen.files))
        url = line.rpartition(" ")[2].strip()
        wait_for_worker(url)
        operators = [Operator(url, index, drone.address, asked) for index, drone in enumerate(drones)]
        context = multiprocessing.get_context("spawn")
        clients, theirs = context.Pipe()
        context.Process(target=watch, args=(url, theirs), daemon=True).start()
        clients.recv()
        if chosen.idle:
            silent, theirs = context.Pipe()
            where = LOOPBACK, int(url.rpartition(":")[2])
            context.Process(target=idle, args=(where, chosen.idle, theirs), daemon=True).start()
            silent.recv()
            stack.callback(_told, silent, chosen.idle)
        together([partial(each.order_landings, seconds / 4.0) for each in operators])
        together([partial(each.abort_flights, seconds) for each in operators])
        clients.send("count")
        heard = clients.recv()
        sent = {index: drone.frames() for index, drone in enumerate(drones)}
    failed = judge("aborts of flights, 20 clients watching", delays_s(asked.aborts, sent, ends_a_flight))
    failed |= judge("Land ordered on the ground", delays_s(asked.orders, sent, is_landing))
    print(f"telemetry messages of the slowest client: {heard}, of {len(asked.aborts)} flights")
    return int(failed or heard == 0)


def _told(silent: Connection, connections: int) -> None:
    silent.send("end")
    print(f"{connections} idle connections; the server closed {silent.recv()} of them, opened again each time")


def wait_for_worker(url: str) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while json.loads(httpx2.get(f"{url}/api/health", timeout=PATIENCE_S).text)["worker"] != "running":
        assert time.monotonic() < deadline_s
        time.sleep(0.1)


if __name__ == "__main__":
    sys.exit(main())
