"""Latency of a command while telemetry streams to many readers, and processor time of recording.

    ./dev exec python -m bench.link [--seconds 20]

Another process acts as the vehicle: it streams over the loopback interface and records when each packet arrives. The
commands of an abort are sent at random instants while 20 threads read every sample and write it as JSON; in the last
case one more thread computes continuously. Then telemetry is only recorded, to memory and to a telemetry log, and the
processor time of this process is measured. Prints the figures. Exits with 1 if a latency is above 50 ms at the 99th
percentile, a command or a sample was lost, or recording takes more than a tenth of a core.
"""

import argparse
import json
import multiprocessing
import queue
import random
import select
import socket
import struct
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import numpy as np

from app.autopilots.dialects import PAPARAZZI, FieldValue, Message, number
from app.core.clock import ScaledClock
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.link import Link

LIMIT_S: Final = 0.05
CORE_SHARE_LIMIT: Final = 0.1
READERS: Final = 20
COMMANDS_A_SECOND: Final = 100.0
PATIENCE_S: Final = 2.0
LOOPBACK: Final = "127.0.0.1"
SYSTEM: Final = 31
SO_TIMESTAMPNS: Final = 35
"""Linux socket option: the kernel attaches the time of arrival to each packet, however busy the receiver is."""
SEED: Final = 20261121
FIELDS: Final = ("time_boot_ms", "x", "y", "z", "vx", "vy", "vz")

Arrivals = dict[int, int]
"""Times at which the operating system received the commands, ns since 1970."""


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The streaming process: its address, and the pipe that ends it."""

    address: Address
    pipe: Connection

    def begin(self) -> None:
        """Begin to stream; packets sent before a receiver is open would be lost."""
        self.pipe.send("begin")

    def end(self) -> tuple[int, Arrivals]:
        """End the process and return the number of samples sent and the times at which commands arrived."""
        self.pipe.send("end")
        sent: int
        arrivals: Arrivals
        sent, arrivals = self.pipe.recv()
        return sent, arrivals


def fly(pipe: Connection, rate_hz: float) -> None:
    """Stream positions at `rate_hz` and record what arrives; the main function of the vehicle's process.

    The pipe begins and ends it.
    """
    codec = PAPARAZZI.codec(system=SYSTEM, component=190)
    arrived: list[tuple[int, bytes]] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind((LOOPBACK, 0))
        wire.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        pipe.send(wire.getsockname()[1])
        ground = (LOOPBACK, pipe.recv())
        pipe.recv()
        start_s, sent = time.monotonic(), 0
        while not pipe.poll():
            wait_s = start_s + sent / rate_hz - time.monotonic()
            if select.select([wire], [], [], max(wait_s, 0.0))[0]:
                frame, ((_, _, stamp),), _, _ = wire.recvmsg(4096, 64)
                seconds, nanoseconds = struct.unpack("@qq", stamp)
                arrived.append((seconds * 10**9 + nanoseconds, frame))
            elif wait_s <= 0.0:
                wire.sendto(codec.pack(PAPARAZZI.message("LOCAL_POSITION_NED", sample(sent, rate_hz))), ground)
                sent += 1
    commands = [(at_ns, message) for at_ns, frame in arrived for message in codec.parse(frame)]
    pipe.send((sent, {int(number(message, "param1")): at_ns for at_ns, message in commands}))


def sample(step: int, rate_hz: float) -> dict[str, FieldValue]:
    return dict(zip(FIELDS, (round(1e3 * step / rate_hz), 0.1, -0.2, -3.0, 0.01, -0.01, 0.5), strict=True))


@contextmanager
def vehicle(rate_hz: float) -> Iterator[Vehicle]:
    """Start a vehicle that waits to stream."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        local = probe.getsockname()[1]
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=fly, args=(theirs, rate_hz), daemon=True)
    process.start()
    port = ours.recv()
    ours.send(local)
    yield Vehicle(Address("udp", LOOPBACK, port, local), ours)
    process.join()


def serve(samples: "queue.SimpleQueue[Message | None]") -> None:
    """Write every sample as JSON, as a live view would send it."""
    while (message := samples.get()) is not None:
        json.dumps({field: number(message, field) for field in FIELDS})


def distribute(link: Link, readers: list["queue.SimpleQueue[Message | None]"], done: threading.Event) -> None:
    """Pass everything received to all readers."""
    while not done.is_set():
        for each in link.receive(0.05):
            for reader in readers:
                reader.put(each.message)
    for reader in readers:
        reader.put(None)


def compute(done: threading.Event) -> None:
    while not done.is_set():
        sum(range(1000))


@contextmanager
def audience(link: Link, *, is_computing: bool) -> Iterator[None]:
    done = threading.Event()
    readers: list[queue.SimpleQueue[Message | None]] = [queue.SimpleQueue() for _ in range(READERS)]
    threads = [threading.Thread(target=serve, args=(reader,)) for reader in readers]
    threads.append(threading.Thread(target=distribute, args=(link, readers, done)))
    if is_computing:
        threads.append(threading.Thread(target=compute, args=(done,)))
    for thread in threads:
        thread.start()
    yield
    done.set()
    for thread in threads:
        thread.join()


def latencies_s(rate_hz: float, seconds: float, *, is_computing: bool) -> tuple[list[float], int]:
    """Return the delay from `Link.send` to arrival of each command, and how many did not arrive."""
    randomness = random.Random(SEED)
    sent_ns: list[int] = []
    with vehicle(rate_hz) as drone, tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "flight.tlog"
        with closing(Link(drone.address, PAPARAZZI, clock=ScaledClock(), target_system=SYSTEM, tlog=log)) as link:
            drone.begin()
            with audience(link, is_computing=is_computing):
                until_s = time.monotonic() + seconds
                while time.monotonic() < until_s:
                    time.sleep(randomness.expovariate(COMMANDS_A_SECOND))
                    sent_ns.append(time.time_ns())
                    link.send("COMMAND_LONG", **command(len(sent_ns) - 1))
                time.sleep(0.1)
            _, arrivals = drone.end()
    return [(at_ns - sent_ns[index]) * 1e-9 for index, at_ns in arrivals.items()], len(sent_ns) - len(arrivals)


def command(index: int) -> dict[str, FieldValue]:
    parameters: dict[str, FieldValue] = {f"param{place}": 0.0 for place in range(2, 8)}
    header: dict[str, FieldValue] = {"target_system": SYSTEM, "target_component": 0, "command": 21, "confirmation": 0}
    return header | parameters | {"param1": float(index)}


def recording_share(rate_hz: float, seconds: float) -> tuple[float, int, int]:
    """Return the share of a core that recording takes, and the numbers of samples recorded and sent."""
    recorded: list[Message] = []
    with vehicle(rate_hz) as drone, tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "flight.tlog"
        with closing(Link(drone.address, PAPARAZZI, clock=ScaledClock(), target_system=SYSTEM, tlog=log)) as link:
            drone.begin()
            start_s, used_s = time.monotonic(), time.process_time()
            while time.monotonic() - start_s < seconds:
                recorded += [each.message for each in link.receive(0.05)]
            share = (time.process_time() - used_s) / (time.monotonic() - start_s)
            sent, _ = drone.end()
            while len(recorded) < sent and time.monotonic() - start_s < seconds + PATIENCE_S:
                recorded += [each.message for each in link.receive(0.05)]
    return share, len(recorded), sent


def main() -> int:
    asked = argparse.ArgumentParser(prog="bench.link")
    asked.add_argument("--seconds", type=float, default=1.5, help="duration of each measurement")
    seconds = asked.parse_args().seconds
    failed = False
    for rate_hz, is_computing in ((50.0, False), (500.0, False), (500.0, True)):
        delays_s, missing = latencies_s(rate_hz, seconds, is_computing=is_computing)
        median_s, high_s = np.quantile(delays_s, [0.5, 0.99])
        print(
            f"telemetry at {rate_hz:.0f} Hz to {READERS} readers{', one thread computing' if is_computing else ''}: "
            f"{len(delays_s)} commands, p50 {median_s * 1e3:.2f} ms, p99 {high_s * 1e3:.2f} ms "
            f"(limit {LIMIT_S * 1e3:.0f}), max {max(delays_s) * 1e3:.2f} ms, {missing} lost"
        )
        failed |= high_s > LIMIT_S or missing > 0
    share, recorded, sent = recording_share(50.0, seconds)
    print(f"recording 50 Hz: {share:.1%} of a core (limit {CORE_SHARE_LIMIT:.0%}), {recorded} of {sent} samples")
    failed |= share > CORE_SHARE_LIMIT or recorded < sent
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
