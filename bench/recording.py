"""Completeness and processor time of the record of a long flight.

    ./dev exec python -m bench.recording [--minutes 10] [--autopilot px4]

Another process runs a simulated drone in real time; this one flies a whole trial with a record of that length and a
telemetry log. Positions are identified by the vehicle's own time stamps: each that was sent between the first and the
last of the record must be exactly once in the record and once in the log. Processor time is that of this process from
the takeoff command to the end of the record. Prints the figures; exits with 1 if a sample is missing or recording
takes more than a tenth of a core, or more in proportion on a slower machine.
"""

import argparse
import multiprocessing
import resource
import socket
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from app.autopilots.dialects import Message, number
from app.autopilots.registry import AUTOPILOTS
from app.core.clock import ScaledClock
from app.simdrone.catalogue import get_autopilot, new_body
from app.simdrone.drone import Drone, Server
from app.vehicles.base import RECORDED_BEYOND_S, FlightOptions, FlightRecord, OptionValue, Sample
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.preparation import GroundObservation
from app.vehicles.mavlink.transports import Peer, Transport, open_transport
from app.vehicles.mavlink.trial import TrialRunner
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mavlink_kind import MAVLINK
from bench.timing.machine import slowness

CORE_SHARE_LIMIT: Final = 0.1
DEFAULT_S: Final = 30.0
LOOPBACK: Final = "127.0.0.1"
POSITION: Final = "LOCAL_POSITION_NED"
BOOT_S: Final = 4.0
"""Time until the drone has a position."""
GAINS: Final[Mapping[str, Mapping[str, float]]] = {
    "ardupilot": {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_D": 0.0, "PSC_ACCZ_I": 1.0},
    "px4": {"MPC_Z_P": 1.0, "MPC_Z_VEL_P_ACC": 4.0, "MPC_Z_VEL_D_ACC": 0.0, "MPC_Z_VEL_I_ACC": 2.0},
}
"""Autopilots whose hover has no time limit."""


@dataclass(frozen=True, slots=True)
class DroneReport:
    """What a drone sent while it was on, for `on_s`, and by how much its clock is late on a slow computer."""

    sent_ms: list[int]
    packets: int
    on_s: float
    late_s: float


class Counting:
    """A transport that records the time stamp of every position that it sends."""

    def __init__(self, transport: Transport, autopilot: str) -> None:
        self._transport = transport
        self._codec = AUTOPILOTS[autopilot].dialect.codec(system=1, component=1)
        self.sent_ms: list[int] = []
        self.packets = 0

    @property
    def remote(self) -> Peer | None:
        return self._transport.remote

    @remote.setter
    def remote(self, peer: Peer | None) -> None:
        self._transport.remote = peer

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:
        return self._transport.read(timeout_s)

    def write(self, data: bytes) -> bool:
        self.packets += 1
        self.sent_ms += stamps(self._codec.parse(data))
        return self._transport.write(data)

    def wake(self) -> None:
        self._transport.wake()

    def close(self) -> None:
        self._transport.close()


def stamps(messages: list[Message]) -> list[int]:
    """Return the vehicle's time stamp, ms, of every position in these packets."""
    return [int(number(message, "time_boot_ms")) for message in messages if message.get_type() == POSITION]


def be_vehicle(pipe: Connection, autopilot: str, address: Address) -> None:
    """Run the drone until the pipe ends it, then report what it sent; the main function of a process."""
    kind = get_autopilot(autopilot)
    transport = Counting(open_transport(address), autopilot)
    drone = Drone(new_body("twin", {"scatter": 0.0}, seed=1), lambda body: kind.set_up(body, kind.system))
    server = Server(drone, transport, ScaledClock())
    thread = threading.Thread(target=server.run)
    thread.start()
    pipe.send("on")
    pipe.recv()
    server.stop()
    thread.join()
    pipe.send(DroneReport(transport.sent_ms, transport.packets, drone.time_s, server.lost_s))


class LongRecord(MavlinkVehicle):
    """The usual vehicle; `kept_ms` are the time stamps of its samples."""

    kept_ms: tuple[int, ...] = ()

    def _record(self, flown: TrialRunner, ground: GroundObservation) -> FlightRecord:
        self.kept_ms = tuple(round(kept.position.time_boot_s * 1000.0) for kept in flown.samples)
        return super()._record(flown, ground)


@dataclass(slots=True)
class Meter:
    """Meter of this process's processor time, from the command to the end of a record of `until_s`."""

    until_s: float
    begun_s: float = 0.0
    used_s: float = 0.0
    lasted_s: float = 0.0
    _used_before_s: float = 0.0

    def see(self, sample: Sample) -> None:
        if not self.begun_s:
            self.begun_s, self._used_before_s = time.monotonic(), processor_s()
        if sample.time_s <= self.until_s:
            self.lasted_s = time.monotonic() - self.begun_s
            self.used_s = processor_s() - self._used_before_s

    @property
    def share(self) -> float:
        return self.used_s / self.lasted_s if self.lasted_s else float("inf")


def processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def fly(autopilot: str, options: dict[str, OptionValue], meter: Meter) -> tuple[FlightRecord, Counter[int]]:
    """Fly a whole trial and return its record, with the count of each time stamp in it."""
    clock = ScaledClock(float(options["clock_speed"]))
    vehicle = LongRecord(options, GAINS[autopilot], is_real=False, clock=clock)
    try:
        vehicle.stage(GAINS[autopilot])
        order = FlightOptions(seed=1, window_s=meter.until_s - RECORDED_BEYOND_S)
        record = vehicle.fly(order, on_sample=meter.see, should_stop=lambda: None)
    finally:
        vehicle.close()
    if len(vehicle.kept_ms) != len(record.trajectory.time_s):
        raise AssertionError("The record does not consist of the samples that were stored.")
    return record, Counter(vehicle.kept_ms)


def logged(folder: Path, autopilot: str) -> Counter[int]:
    """Count the positions in the telemetry log by time stamp."""
    [log] = folder.glob("*.tlog")
    codec, data = AUTOPILOTS[autopilot].dialect.codec(system=1, component=1), log.read_bytes()
    found: list[int] = []
    place = 0
    while place < len(data):
        frame_at = place + 8
        size = 12 + data[frame_at + 1] if data[frame_at] == 0xFD else 8 + data[frame_at + 1]
        found += stamps(codec.parse(data[frame_at : frame_at + size]))
        place = frame_at + size
    return Counter(found)


@contextmanager
def vehicle_process(autopilot: str, address: Address) -> Iterator[Connection]:
    """Run the drone in another process and yield it ready to fly."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=be_vehicle, args=(theirs, autopilot, address), daemon=True)
    process.start()
    ours.recv()
    time.sleep(BOOT_S)
    try:
        yield ours
    finally:
        process.terminate()
        process.join()


def measure(autopilot: str, seconds: float) -> bool:
    """Fly, print the figures and return whether all are within their limits."""
    here, there = free_port(), free_port()
    meter = Meter(seconds)
    chosen: dict[str, OptionValue] = {"autopilot": autopilot, "simulated": True}
    address, ground = str(Address("udp", LOOPBACK, there, here)), Address("udp", LOOPBACK, here, there)
    with tempfile.TemporaryDirectory() as folder, vehicle_process(autopilot, ground) as pipe:
        options = MAVLINK.check({**chosen, "address": address, "log_folder": folder}, field="options")
        before, (record, kept), after = slowness(), fly(autopilot, options, meter), slowness()
        in_log = logged(Path(folder), autopilot)
        pipe.send("end")
        reported: DroneReport = pipe.recv()
    return report(record, meter, kept, in_log, reported, (before + after) / 2.0)


def report(
    record: FlightRecord,
    meter: Meter,
    kept: Counter[int],
    in_log: Counter[int],
    reported: DroneReport,
    slow: float,
) -> bool:
    first_ms, last_ms = min(kept), max(kept)
    sent = [each for each in reported.sent_ms if first_ms <= each <= last_ms]
    missing = sum(kept[each] != 1 for each in sent) + len(set(kept) - set(sent))
    unlogged = sum(in_log[each] != 1 for each in sent)
    time_s = record.trajectory.time_s
    print(
        f"{record.ending} after {time_s[-1]:.0f} s{f' ({record.reason})' if record.reason else ''}: "
        f"{len(sent)} positions sent, {len(sent) / (time_s[-1] - time_s[0]):.1f} a second "
        f"({reported.packets / reported.on_s:.0f} packets of all kinds), {missing} not once in the record, "
        f"{unlogged} not once in the log; {meter.share:.1%} of a core (limit {CORE_SHARE_LIMIT:.0%} × {slow:.2f})"
    )
    if reported.late_s > 0.0:
        print(f"this computer was too slow for the drone: its clock is {reported.late_s:.1f} s late")
    is_complete = record.ending == "completed" and not missing and not unlogged
    return is_complete and meter.share <= CORE_SHARE_LIMIT * slow


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.recording")
    parser.add_argument("--minutes", type=float, default=DEFAULT_S / 60.0, help="length of the record")
    parser.add_argument("--autopilot", choices=tuple(GAINS), default="ardupilot")
    options = parser.parse_args()
    return 0 if measure(options.autopilot, options.minutes * 60.0) else 1


if __name__ == "__main__":
    sys.exit(main())
