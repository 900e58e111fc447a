"""Recorded traffic of whole trials with the real Paparazzi autopilot, both directions, read back."""

import gzip
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from app.autopilots.dialects import PAPARAZZI, Dialect, Message, source_system

LOGS = Path(__file__).parents[2] / "data" / "logs"
VEHICLE = 31
_MAVLINK_1 = 0xFE
GROUND_STATION = 255
FLOWN = [(283, 13, 82), (1624, 1356, 195)]
"""Gains (kp, ki, kd) of the trials that were recorded."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message on the wire, s since the first."""

    time_s: float
    message: Message

    @property
    def kind(self) -> str:
        return self.message.get_type()

    @property
    def is_from_vehicle(self) -> bool:
        return source_system(self.message) == VEHICLE


@cache
def recorded(gains: tuple[int, int, int]) -> tuple[Recorded, ...]:
    """Every message of one trial in the order of the wire."""
    return tuple(read(LOGS / f"paparazzi_{'_'.join(map(str, gains))}.tlog", PAPARAZZI))


def read(path: Path, dialect: Dialect) -> Iterator[Recorded]:
    """Every message of a telemetry log, which may be compressed."""
    data = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    codec = dialect.codec(system=GROUND_STATION, component=190)
    (first_us,) = struct.unpack_from(">Q", data)
    at = 0
    while at < len(data):
        (time_us,) = struct.unpack_from(">Q", data, at)
        length = data[at + 9] + (8 if data[at + 8] == _MAVLINK_1 else 12)
        for message in codec.parse(data[at + 8 : at + 8 + length]):
            yield Recorded((time_us - first_us) / 1e6, message)
        at += 8 + length


def messages(gains: tuple[int, int, int], *kinds: str, from_vehicle: bool) -> list[Recorded]:
    return [each for each in recorded(gains) if each.kind in kinds and each.is_from_vehicle is from_vehicle]
