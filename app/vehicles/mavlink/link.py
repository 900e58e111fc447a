"""MAVLink link to one vehicle.

The link receives in its own thread, or, with a given transport, in the thread that calls `receive`. Commands are sent
without waiting in the thread of the caller: passed to the link's thread, they would wait for the threads that compute
(bench/link.py measures it).
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from app.autopilots.dialects import (
    BAD_DATA,
    GROUND_STATION,
    NO_AUTOPILOT,
    Codec,
    Dialect,
    FieldValue,
    Message,
    is_autopilots_heartbeat,
    is_known,
    number,
    sequence,
    source_component,
    source_system,
)
from app.core.clock import Clock
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.reception import GONE_AFTER_S, DuplicateDetector, LinkHealth, LossCounter, OtherPeers
from app.vehicles.mavlink.tlog import TlogWriter
from app.vehicles.mavlink.transports import LinkError, Peer, Transport, open_transport

HEARTBEAT_EVERY_S: Final = 1.0
UNATTENDED_AFTER_S: Final = 3.0
"""If `receive` has not been called for this long, the program hangs. No more heartbeats are sent then, so that the
vehicle's own failsafe for a lost ground station can act."""
MAX_QUEUED_MESSAGES: Final = 20_000
"""Maximum number of messages that wait for `receive`; beyond it the oldest are dropped."""
STEP_S: Final = 1.0 / 256.0
"""Step of the clock between two reads of a transport without a thread."""
DUPLICATE_TIMEOUT_S: Final = 3.0
"""Time for which messages of another peer with the vehicle's ids count."""

_TOLD_ONCE: Final = frozenset({"PARAM_VALUE", "COMMAND_ACK", "MISSION_ACK", "SCRIPT_CURRENT"})
"""Messages of something that has happened: a copy of one that arrives later is out of date."""

_COMPONENT: Final = 190
"""The usual one of a ground station (MAV_COMP_ID_MISSIONPLANNER)."""
MAV_TYPE_GCS: Final = 6
MAV_STATE_ACTIVE: Final = 4


@dataclass(frozen=True, slots=True)
class Received:
    """A message and its time of receipt, in seconds of the link's clock."""

    message: Message
    received_s: float


class Link:
    """Sends to and receives from one vehicle; safe to use from any thread.

    `target_system` is the vehicle's system id, None for the first autopilot received; `make` is its MAV_AUTOPILOT, None
    for any. Messages of its other components are received, too, but do not count as packets of the autopilot. With
    `tlog`, both directions are appended to that file. With `signing_key`, everything is signed. With `transport`, no
    thread is started: `receive` reads the transport and advances the clock while nothing arrives. No heartbeats are
    sent while `is_silent` returns true, which the link's own thread calls.
    """

    def __init__(
        self,
        address: Address,
        dialect: Dialect,
        *,
        clock: Clock,
        target_system: int | None = None,
        make: int | None = None,
        tlog: Path | None = None,
        signing_key: bytes | None = None,
        transport: Transport | None = None,
        is_silent: Callable[[], bool] = lambda: False,
    ) -> None:
        """Open the link. Raises LinkError if the address or the file cannot be opened, InputError if the dialect cannot
        be signed."""
        self._address, self._dialect, self._clock = address, dialect, clock
        self._signing_key, self._is_silent = signing_key, is_silent
        self._codec = self._new_codec()
        self._heartbeat = dialect.message("HEARTBEAT", _GROUND_STATION)
        self._transport = transport or open_transport(address)
        try:
            self._tlog = TlogWriter(tlog) if tlog else None
        except LinkError:
            self._transport.close()
            raise
        self._opened_s, self._opened_unix_us = clock.now_s(), time.time_ns() // 1000
        self._vehicle_system, self._make = target_system, make
        self._vehicle_component: int | None = None
        self._duplicates = DuplicateDetector()
        self._others = OtherPeers()
        self._last_number = 0
        self._duplicate_s = float("-inf")
        self._other_makes: set[int] = set()
        self._losses = LossCounter(dialect.uncounted)
        self._plan: dict[float, bytes] = {}
        self._health = LinkHealth()
        self._next_heartbeat_s = self._attended_s = self._opened_s
        self._listeners = 0
        self._inbox: deque[Received] = deque(maxlen=MAX_QUEUED_MESSAGES)
        self._inbox_changed = threading.Condition()
        self._sending = threading.Lock()
        self._is_closing = self._is_closed = False
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None
        if transport is None:
            self._thread = threading.Thread(target=self._run, name=f"link {address}", daemon=True)
            self._thread.start()

    @property
    def duplicate_reason(self) -> str:
        """Evidence that two vehicles use the system id; empty without evidence."""
        now_s = self._clock.now_s()
        with self._inbox_changed:
            if now_s - self._duplicate_s < DUPLICATE_TIMEOUT_S:
                return "Another vehicle with the same system id sends from another address."
            return self._duplicates.reason(now_s)

    @property
    def other_makes(self) -> frozenset[int]:
        """Other autopilots that were received, by MAV_AUTOPILOT."""
        return frozenset(self._other_makes)

    @property
    def log_problem(self) -> str | None:
        """Reason why the telemetry log is incomplete, None if it is complete."""
        return self._tlog.problem if self._tlog else None

    @property
    def health(self) -> LinkHealth:
        with self._inbox_changed:
            return replace(self._health, lost=self._losses.lost)

    def send(self, kind: str, **fields: FieldValue) -> None:
        """Send the message `kind` ("PARAM_SET") without waiting; on return it was sent, or dropped: without a peer or
        connection, or because a buffer is full.

        Raises ValueError for a message or fields that the dialect does not have, LinkError if the link is closed.
        """
        message = self._dialect.message(kind, fields)
        with self._sending:
            if self._is_closing or self._is_closed:
                raise self._closed_error()
            self._write(message)

    def receive(self, timeout_s: float) -> list[Received]:
        """Return all messages since the last call, oldest first; wait at most `timeout_s` of the clock for the first.

        Every message is returned once, to any caller. Raises LinkError if the link is closed and no message is left.
        """
        with self._inbox_changed:
            self._listeners += 1
            try:
                self._wait_for_messages(timeout_s)
            finally:
                self._listeners -= 1
                self._attended_s = self._clock.now_s()
            if self._is_closed and not self._inbox:
                raise self._closed_error()
            messages = list(self._inbox)
            self._inbox.clear()
        return messages

    def log_to(self, path: Path | None) -> None:
        """Record all packets from now on in another telemetry log, which begins with the vehicle's plan as last
        received, or in none; return once the previous log is stored. Raises LinkError if the file cannot be opened; the
        previous log then continues."""
        following = TlogWriter(path) if path else None
        before, self._tlog = self._tlog, following
        for frame in list(self._plan.values()):
            self._record(frame)
        if before:
            before.close()

    def close(self) -> None:
        """Close the link; return once the log is stored. Calling it again has no effect."""
        with self._sending:
            self._is_closing = True
            if not self._is_closed:
                self._transport.wake()
        if self._thread is None:
            self._end()
        else:
            self._thread.join()
        if self._tlog:
            self._tlog.close()

    def _closed_error(self) -> LinkError:
        why = f"failed: {self._failure}" if self._failure else "is closed"
        return LinkError(f"The link {self._address} {why}.", hint="Connect to the vehicle again.")

    def _wait_for_messages(self, timeout_s: float) -> None:
        if self._thread is not None:
            self._inbox_changed.wait_for(lambda: self._inbox or self._is_closed, self._clock.wall_s(timeout_s))
            return
        until_s = self._clock.now_s() + timeout_s
        while not self._is_closed:
            self._attend(0.0)
            if self._inbox or self._clock.now_s() >= until_s:
                return
            self._clock.wait_s(STEP_S)

    # ---- in the link's own thread, if it has one

    def _run(self) -> None:
        try:
            while not self._is_closing:
                self._attend(self._clock.wall_s(max(self._next_heartbeat_s - self._clock.now_s(), 0.0)))
        except Exception as error:
            self._failure = error
            raise
        finally:
            self._end()

    def _attend(self, timeout_s: float) -> None:
        """Send a heartbeat if it is due, then receive; `timeout_s` is wall time."""
        self._send_heartbeat()
        for data, peer in self._transport.read(timeout_s):
            self._process_data(data, peer)

    def _end(self) -> None:
        with self._sending, self._inbox_changed:
            self._is_closed = True
            self._transport.close()
            self._inbox_changed.notify_all()

    def _send_heartbeat(self) -> None:
        now_s = self._clock.now_s()
        if now_s < self._next_heartbeat_s:
            return
        self._next_heartbeat_s = now_s + HEARTBEAT_EVERY_S
        is_attended = self._listeners > 0 or now_s - self._attended_s < UNATTENDED_AFTER_S
        if self._dialect.uses_gcs_heartbeats and is_attended and not self._is_silent():
            with self._sending:
                self._write(self._heartbeat)

    def _write(self, message: Message) -> None:
        """Send a message; the caller holds the lock for sending."""
        frame = self._codec.pack(message)
        if self._transport.write(frame):
            self._record(frame)

    def _process_data(self, data: bytes, peer: Peer) -> None:
        remote = self._transport.remote
        if remote == peer:
            self._queue(self._codec.parse(data))
        elif remote is None:
            self._process_unknown_peer(data, peer)
        else:
            self._health.foreign += 1
            self._process_other_peer(data, peer, is_same_host=peer[0] == remote[0])

    def _process_unknown_peer(self, data: bytes, peer: Peer) -> None:
        """Process a datagram with a separate codec, because data of an unknown peer must not interfere with the
        vehicle's first packet."""
        messages = self._new_codec().parse(data)
        if any(self._is_vehicle(message) for message in messages):
            self._transport.remote = peer
            self._queue(messages)
        else:
            self._health.foreign += 1

    def _process_other_peer(self, data: bytes, peer: Peer, *, is_same_host: bool) -> None:
        """Adopt the vehicle's new port; otherwise find out whether another vehicle uses its ids."""
        now_s = self._clock.now_s()
        since_s = self._health.last_packet_s if self._health.last_packet_s is not None else self._opened_s
        is_gone = now_s - since_s > GONE_AFTER_S
        if is_gone and is_same_host:
            if any(self._is_vehicle(message) for message in self._new_codec().parse(data)):
                self._transport.remote = peer
        elif not is_gone and self._health.last_packet_s is not None and self._others.may_check(peer, now_s):
            message = next((each for each in self._new_codec().parse(data) if self._poses_as_vehicle(each)), None)
            if message is None:
                return
            verdict = self._others.add(
                peer, sequence(message), now_s, last_number=self._last_number, last_s=self._health.last_packet_s
            )
            if verdict == "duplicate":
                self._duplicate_s = now_s
            elif verdict == "moved" and is_same_host:
                self._transport.remote = peer

    def _poses_as_vehicle(self, message: Message) -> bool:
        """Whether a message of another peer has the vehicle's ids, and is no copy of one of its own."""
        if not is_known(message) or self._duplicates.has_seen(bytes(message.get_msgbuf())):
            return False
        is_counted = not message.get_type().startswith(self._dialect.uncounted)
        ids = (source_system(message), source_component(message))
        return is_counted and ids == (self._vehicle_system, self._vehicle_component)

    def _is_vehicle(self, message: Message) -> bool:
        """Whether the message identifies its sender as the vehicle of this link."""
        if not is_autopilots_heartbeat(message):
            return False
        make = int(number(message, "autopilot"))
        if self._make not in (None, make):
            self._other_makes.add(make)
            return False
        is_its_system = self._vehicle_system in (None, source_system(message))
        return is_its_system and self._vehicle_component in (None, source_component(message))

    def _queue(self, messages: list[Message]) -> None:
        now_s = self._clock.now_s()
        fresh = [Received(message, now_s) for message in messages if self._accepts(message, now_s)]
        if not fresh:
            return
        with self._inbox_changed:
            self._inbox.extend(fresh)
            self._inbox_changed.notify_all()

    def _accepts(self, message: Message, now_s: float) -> bool:
        """Count and record the message; return whether `receive` should return it."""
        if message.get_type() == BAD_DATA:  # a wrong checksum, or a wrong signature
            return False
        is_autopilot = self._is_vehicle(message)
        if is_autopilot:
            self._vehicle_system, self._vehicle_component = source_system(message), source_component(message)
        if source_system(message) != self._vehicle_system:
            self._health.foreign += 1
            return False
        frame = bytes(message.get_msgbuf())
        self._losses.count(message.get_type(), source_component(message), sequence(message))
        self._record(frame)
        if not is_known(message):  # neither its checksum nor its signature was checked
            return False
        self._health.received += 1
        if message.get_type() == self._dialect.plan:
            self._plan[number(message, "seq")] = frame
        if self._vehicle_component in (None, source_component(message)):
            self._health.last_packet_s = now_s
            counts = not message.get_type().startswith(self._dialect.uncounted)
            self._last_number = sequence(message) if counts else self._last_number
            is_copy = self._duplicates.add(frame, sequence(message), now_s, _boot_s(message), is_counted=counts)
            if is_copy and message.get_type() in _TOLD_ONCE:
                return False
        if is_autopilot:
            self._health.last_heartbeat_s = now_s
        return True

    def _record(self, frame: bytes) -> None:
        if tlog := self._tlog:
            passed_us = round((self._clock.now_s() - self._opened_s) * 1e6)
            tlog.write(self._opened_unix_us + passed_us, frame)

    def _new_codec(self) -> Codec:
        return self._dialect.codec(system=GROUND_STATION, component=_COMPONENT, signing_key=self._signing_key)


_GROUND_STATION: Final[dict[str, FieldValue]] = {
    "type": MAV_TYPE_GCS,
    "autopilot": NO_AUTOPILOT,
    "base_mode": 0,
    "custom_mode": 0,
    "system_status": MAV_STATE_ACTIVE,
    "mavlink_version": 3,
}


def _boot_s(message: Message) -> float | None:
    """Return the vehicle's time from LOCAL_POSITION_NED; the time of other messages may advance when that is frozen."""
    return number(message, "time_boot_ms") / 1000.0 if message.get_type() == "LOCAL_POSITION_NED" else None
