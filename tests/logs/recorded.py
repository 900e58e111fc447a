"""The recorded logs (tests/data/logs), and logs put together message by message."""

import gzip
import io
import struct
from pathlib import Path
from typing import Any

from app.log_library.service import EXAMPLE

LOGS = Path(__file__).parent.parent / "data" / "logs"
TAKEOFFS = LOGS.parent / "takeoffs"

TLOGS = {
    "paparazzi_283_13_82": {"kp": 283.0, "ki": 13.0, "kd": 82.0},
    "paparazzi_1624_1356_195": {"kp": 1624.0, "ki": 1356.0, "kd": 195.0},
}
SCRIPT_CURRENT_4 = bytes([31, 190, 184, 4, 0])
"""Sender, number and payload of the message that the recorded vehicle had entered the block of its takeoff."""
BEGAN_US = 1_795_222_159_000_000


def recorded(name: str) -> bytes:
    """The content of a recorded log, uncompressed."""
    if (path := LOGS / name).exists():
        return path.read_bytes()
    return gzip.decompress((_ELSEWHERE.get(name) or LOGS / f"{name}.gz").read_bytes())


_ELSEWHERE = {"arducopter_steps.bin": EXAMPLE}
"""Recorded logs that come with the program."""


SIZES = {
    letter: size
    for size, letters in ((1, "bBM"), (2, "hHcCg"), (4, "iIeELfn"), (8, "qQd"), (16, "N"), (64, "Za"))
    for letter in letters
} | {"?": 0}
"""Bytes of a column by its letter."""


class OnBoardLog:
    """An on-board log put together by hand."""

    def __init__(self) -> None:
        self.content = b""
        self._lengths = {128: 89}
        self.define(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", length=89)

    def define(self, kind: int, name: str, letters: str, columns: str, *, length: int | None = None) -> None:
        total = 3 + sum(SIZES[letter] for letter in letters) if length is None else length
        self.content += struct.pack(
            "<3sBB4s16s64s", b"\xa3\x95\x80", kind, total, name.encode(), letters.encode(), columns.encode()
        )

    def add(self, kind: int, layout: str, *fields: float | bytes) -> None:
        self.content += b"\xa3\x95" + bytes([kind]) + struct.pack(layout, *fields)


ULOG_HEADER = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1)


def ulog_message(kind: str, body: bytes) -> bytes:
    """One message of a ULog."""
    return struct.pack("<HB", len(body), ord(kind)) + body


class ULogFile:
    """PX4's log put together by hand: topics and parameters first, then rows in order of their time."""

    def __init__(self) -> None:
        self._topics: dict[str, tuple[int, str]] = {}
        self._formats = self._subscriptions = self._parameters = self._information = b""
        self._rows: list[tuple[int, bytes]] = []

    @property
    def content(self) -> bytes:
        """The whole file."""
        rows = (body for _, body in sorted(self._rows, key=lambda row: row[0]))
        return b"".join((ULOG_HEADER, self._information, self._formats, self._parameters, self._subscriptions, *rows))

    def define(self, topic: str, fields: str, layout: str) -> None:
        """A topic with these fields ("float z;float vz;") beside its time, packed by `layout`."""
        number = len(self._topics)
        self._topics[topic] = (number, layout)
        self._formats += ulog_message("F", f"{topic}:uint64_t timestamp;{fields}".encode())
        self._subscriptions += ulog_message("A", b"\0" + struct.pack("<H", number) + topic.encode())

    def information(self, key: str, value: bytes) -> None:
        """A fact about the log, of this type and name ("uint32_t ver_sw_release")."""
        self._information += ulog_message("I", bytes([len(key)]) + key.encode() + value)

    def parameter(self, name: str, value: float, *, at_s: float | None = None) -> None:
        """A parameter from before the log, or changed at a time; whole numbers are integers."""
        kind, layout = ("int32_t", "<i") if isinstance(value, int) else ("float", "<f")
        key = f"{kind} {name}".encode()
        body = ulog_message("P", bytes([len(key)]) + key + struct.pack(layout, value))
        if at_s is None:
            self._parameters += body
        else:
            self._rows.append((round(at_s * 1e6), body))

    def add(self, topic: str, at_s: float, *values: float) -> None:
        """A row of a topic, if it was defined."""
        if topic in self._topics:
            number, layout = self._topics[topic]
            at_us = round(at_s * 1e6)
            self._rows.append((at_us, ulog_message("D", struct.pack("<HQ" + layout, number, at_us, *values))))


class Telemetry:
    """A telemetry log under construction: messages of a vehicle and of a ground station, in one time."""

    def __init__(self, dialect: Any, *, autopilot: int, system: int = 31, component: int = 1) -> None:
        self._dialect = dialect
        self._autopilot = autopilot
        self._senders: dict[tuple[int, int], Any] = {}
        self._address = system, component
        self._content = io.BytesIO()
        self.now_s = 100.0
        self.booted_s = 0.0
        self.began_us = BEGAN_US
        self._altitude_m = 0.0

    @property
    def content(self) -> bytes:
        return self._content.getvalue()

    def vehicle(self, kind: str, *fields: object) -> None:
        self.add(self._address, kind, *fields)

    def component(self, kind: str, *fields: object) -> None:
        """A message of another component of the vehicle."""
        self.add((self._address[0], 154), kind, *fields)

    def ground(self, kind: str, *fields: object) -> None:
        self.add((255, 190), kind, *fields)

    def heartbeat(self, *, armed: bool = True, mode: int = 0) -> None:
        self.vehicle("heartbeat", 2, self._autopilot, 128 if armed else 0, mode, 4)

    def parameter(self, name: str, value: float) -> None:
        self.vehicle("param_value", name.encode(), value, 9, 10, 3)

    def fly(self, duration_s: float, *, to_m: float, rate_hz: float = 50.0) -> None:
        """Position samples in which the altitude approaches `to_m` with a time constant of half a second."""
        for _ in range(round(duration_s * rate_hz)):
            self.now_s += 1.0 / rate_hz
            self._altitude_m += (to_m - self._altitude_m) / (0.5 * rate_hz)
            self.vehicle("local_position_ned", self.boot_ms, 0.0, 0.0, -self._altitude_m, 0.0, 0.0, 0.0)

    @property
    def boot_ms(self) -> int:
        return round(1000 * (self.now_s - self.booted_s))

    def sender(self, address: tuple[int, int]) -> Any:
        """The library's side of a system and component."""
        return self._senders.setdefault(address, self._dialect.MAVLink(None, *address))

    def add(self, address: tuple[int, int], kind: str, *fields: object) -> None:
        """A message of this system and component."""
        sender = self.sender(address)
        message = getattr(sender, f"{kind}_encode")(*fields)
        self._content.write(struct.pack(">Q", self.began_us + round(self.now_s * 1e6)))
        self._content.write(message.pack(sender))
        sender.seq = (sender.seq + 1) % 256
