"""Hazards of the link, which change the packets from a vehicle: the vehicle is sound."""

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

from app.autopilots.dialects import Codec, Dialect, FieldValue, Message, number
from app.simdrone.drone import Drone

COMPANION: Final = 191
ONBOARD_CONTROLLER: Final = 18
QUADROTOR: Final = 2
NO_AUTOPILOT: Final = 8
POSITION: Final = "LOCAL_POSITION_NED"
SIGHTING: Final = "VISION_POSITION_ESTIMATE"
"""Message of the second source of altitude."""
_CLOCK_WRAPS_MS: Final = 1 << 32
FIELDS: Final = ("x", "y", "z", "vx", "vy", "vz")
MAKES: Final[Mapping[str, int]] = {"paparazzi": 9, "ardupilot": 3, "px4": 12}
BY_HAND: Final[Mapping[str, tuple[int, int]]] = {"paparazzi": (64, 0), "ardupilot": (1, 0), "px4": (1, 3 << 16)}
"""base_mode and custom_mode of a mode in which a pilot flies."""
HOVERING: Final[Mapping[str, tuple[int, int]]] = {
    "paparazzi": (4, 0),
    "ardupilot": (1, 4),
    "px4": (1, 3 << 24 | 4 << 16),
}


class LinkHazard(Protocol):
    """Hazard of the link while it is active.

    `transform(frames, now_s)` returns the packets that arrive instead of `frames` in one tick; `now_s` counts from when
    the drone was switched on.
    """

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]: ...


@dataclass
class MessageForger:
    """Writer of messages in the name of the vehicle or another component, and reader of the vehicle's messages."""

    autopilot: str
    dialect: Dialect
    drone: Drone
    chance: random.Random

    def __post_init__(self) -> None:
        self._reading = self.dialect.codec(system=1, component=1)

    def codec(self, component: int, sequence: int = 0) -> Codec:
        codec = self.dialect.codec(system=self.drone.autopilot.system, component=component)
        codec._out.seq = sequence
        return codec

    @property
    def own(self) -> int:
        return self.drone.autopilot.component

    def read(self, frame: bytes) -> Message | None:
        found = self._reading.parse(frame)
        return found[0] if len(found) == 1 else None

    def changed(self, frame: bytes, kind: str, change: Callable[[Message], Mapping[str, FieldValue]]) -> bytes:
        """Return the frame with changed fields and the same sequence number; unchanged if it is of another kind."""
        message = self.read(frame)
        if message is None or message.get_type() != kind:
            return frame
        fields = {name: getattr(message, name) for name in message.get_fieldnames()}
        codec = self.codec(self.own, _sequence(frame))
        return codec.pack(self.dialect.message(kind, {**fields, **change(message)}))

    def heartbeat(
        self, codec: Codec, *, armed: bool, mode: tuple[int, int], kind: int = QUADROTOR, make: int | None = None
    ) -> bytes:
        base, custom = mode
        fields = {
            "type": kind,
            "autopilot": MAKES[self.autopilot] if make is None else make,
            "base_mode": base | (128 if armed else 0),
            "custom_mode": custom,
            "system_status": 4,
            "mavlink_version": 3,
        }
        return codec.pack(self.dialect.message("HEARTBEAT", fields))

    def position(self, codec: Codec, *, height_m: float, boot_s: float) -> bytes:
        fields = dict.fromkeys(FIELDS, 0.0) | {"z": -height_m, "time_boot_ms": max(round(boot_s * 1000.0), 0)}
        return codec.pack(self.dialect.message(POSITION, fields))


@dataclass
class ChangedMessages:
    """Every message of one kind has changed values, or only the next `count` ones."""

    forger: MessageForger
    kind: str
    change: Callable[[Message], Mapping[str, FieldValue]]
    count: float = math.inf

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:  # noqa: ARG002
        return [self.forger.changed(frame, self.kind, self._change) for frame in frames]

    def _change(self, message: Message) -> Mapping[str, FieldValue]:
        self.count -= 1
        return self.change(message) if self.count >= 0 else {}


@dataclass
class MissingMessages:
    """No message of one kind arrives."""

    forger: MessageForger
    kind: str

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:  # noqa: ARG002
        read = ((frame, self.forger.read(frame)) for frame in frames)
        return [frame for frame, message in read if message is None or message.get_type() != self.kind]


@dataclass
class FrozenMessages:
    """Every message of one kind repeats the first one, including its time."""

    forger: MessageForger
    kind: str
    _first: dict[str, FieldValue] = field(default_factory=dict)

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:  # noqa: ARG002
        return [self.forger.changed(frame, self.kind, self._repeat) for frame in frames]

    def _repeat(self, message: Message) -> Mapping[str, FieldValue]:
        self._first = self._first or {name: getattr(message, name) for name in message.get_fieldnames()}
        return self._first


@dataclass
class InsertedMessages:
    """The messages of `forge(now_s)` arrive as well, once or every `every_s`."""

    forge: Callable[[float], list[bytes]]
    every_s: float = math.inf
    _due_s: float = -math.inf

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        if now_s < self._due_s:
            return list(frames)
        self._due_s = now_s + self.every_s
        return [*frames, *self.forge(now_s)]


@dataclass
class DelayedPackets:
    """Every n-th packet arrives `late_s` later; with `copies` it also arrives on time."""

    late_s: float
    every: int
    copies: bool
    _count: int = 0
    _held: list[tuple[float, bytes]] = field(default_factory=list)

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        passed = [frame for due_s, frame in self._held if due_s <= now_s]
        self._held = [(due_s, frame) for due_s, frame in self._held if due_s > now_s]
        for frame in frames:
            self._count += 1
            if self._count % self.every == 0:
                self._held.append((now_s + self.late_s, frame))
                if not self.copies:
                    continue
            passed.append(frame)
        return passed


@dataclass
class LostPackets:
    """A share of the packets is lost."""

    share: float
    chance: random.Random

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:  # noqa: ARG002
        return [frame for frame in frames if self.chance.random() >= self.share]


@dataclass
class GrowingDelay:
    """Every packet arrives later than the one before it, until all arrive `most_s` late."""

    growth: float
    most_s: float
    _since_s: float | None = None
    _held: list[tuple[float, bytes]] = field(default_factory=list)

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        self._since_s = now_s if self._since_s is None else self._since_s
        due_s = now_s + min(self.growth * (now_s - self._since_s), self.most_s)
        self._held += [(due_s, frame) for frame in frames]
        passed = [frame for at_s, frame in self._held if at_s <= now_s]
        self._held = [(at_s, frame) for at_s, frame in self._held if at_s > now_s]
        return passed


@dataclass
class PositionOnGround:
    """The altitude is no number for `gap_s`, and afterwards that of the ground."""

    forger: MessageForger
    gap_s: float
    _since_s: float | None = None

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        self._since_s = now_s if self._since_s is None else self._since_s
        place = {"z": math.nan} if now_s - self._since_s < self.gap_s else {"z": -0.1, "vz": 0.0}
        return [self.forger.changed(frame, POSITION, lambda _: place) for frame in frames]


class ReplacedVehicle:
    """The vehicle is not received any more; after `gap_s` another one with its ids is, on the ground and disarmed."""

    def __init__(self, forger: MessageForger, gap_s: float) -> None:
        self._other, self._gap_s = DuplicateVehicle(forger, 0.0), gap_s
        self._since_s: float | None = None

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        self._since_s = now_s if self._since_s is None else self._since_s
        both = self._other.transform(frames, now_s)
        return [] if now_s - self._since_s < self._gap_s else [frame for frame in both if frame not in frames]


class DuplicateVehicle:
    """A second vehicle with the same ids sends as often as this one; it is on the ground, disarmed, or flies at 2 m."""

    def __init__(self, forger: MessageForger, older_s: float, *, flies: bool = False) -> None:
        self._forger, self._older_s, self._flies = forger, older_s, flies
        self._codec = forger.codec(forger.own, forger.chance.randrange(256))

    def transform(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        both: list[bytes] = []
        for frame in frames:
            both.append(frame)
            message = self._forger.read(frame)
            if message is not None and message.get_type() == POSITION:
                boot_s = now_s + self._older_s
                height_m = 2.0 if self._flies else 0.1
                both.append(self._forger.position(self._codec, height_m=height_m, boot_s=boot_s))
            elif message is not None and message.get_type() == "HEARTBEAT":
                mode = HOVERING[self._forger.autopilot]
                both.append(self._forger.heartbeat(self._codec, armed=self._flies, mode=mode))
        return both


HazardFactory = Callable[[MessageForger], LinkHazard]


def a_number(name: str, value: float) -> HazardFactory:
    return lambda forger: ChangedMessages(forger, POSITION, lambda _: {name: value})


def stamped(ahead_s: float, *, count: float = math.inf) -> HazardFactory:
    """Return a factory of positions whose time is ahead of the true one, or behind it if negative; of the next `count`
    ones, or of all."""

    def change(message: Message) -> Mapping[str, FieldValue]:
        boot_ms = round(number(message, "time_boot_ms") + 1000.0 * ahead_s)
        return {"time_boot_ms": boot_ms % _CLOCK_WRAPS_MS}

    return lambda forger: ChangedMessages(forger, POSITION, change, count)


def wrapping_after(elapsed_s: float) -> HazardFactory:
    """Return a factory of positions whose time returns to 0 when the vehicle has been on for this time."""
    return stamped(_CLOCK_WRAPS_MS / 1000.0 - elapsed_s)


def higher(kind: str, by_m: float) -> HazardFactory:
    return lambda forger: ChangedMessages(forger, kind, lambda message: {"z": number(message, "z") - by_m})


def silence(kind: str) -> HazardFactory:
    return lambda forger: MissingMessages(forger, kind)


def on_ground(gap_s: float) -> HazardFactory:
    return lambda forger: PositionOnGround(forger, gap_s)


def twin(older_s: float) -> HazardFactory:
    return lambda forger: DuplicateVehicle(forger, older_s)


def false_heartbeat(*, every_s: float, armed: bool = False, by_hand: bool = False) -> HazardFactory:
    def make(forger: MessageForger) -> LinkHazard:
        codec = forger.codec(forger.own, forger.chance.randrange(256))
        mode = (BY_HAND if by_hand else HOVERING)[forger.autopilot]
        return InsertedMessages(lambda _: [forger.heartbeat(codec, armed=armed, mode=mode)], every_s)

    return make


def companion(*, poses: bool) -> HazardFactory:
    """Return a factory of heartbeats and positions of a companion computer, which may pose as an autopilot."""

    def make(forger: MessageForger) -> LinkHazard:
        codec = forger.codec(COMPANION)
        kind, maker = (QUADROTOR, None) if poses else (ONBOARD_CONTROLLER, NO_AUTOPILOT)

        def forge(now_s: float) -> list[bytes]:
            beat = forger.heartbeat(codec, armed=False, mode=(0, 0), kind=kind, make=maker)
            return [beat, forger.position(codec, height_m=0.0, boot_s=now_s)]

        return InsertedMessages(forge, 0.5)

    return make


def false_position(
    *, height_m: float, every_s: float, ahead_s: float = 0.0, boot_s: float | None = None
) -> HazardFactory:
    """Return a factory of false positions in the vehicle's name; with `boot_s` all have that time."""

    def make(forger: MessageForger) -> LinkHazard:
        codec = forger.codec(forger.own, forger.chance.randrange(256))

        def forge(_now_s: float) -> list[bytes]:
            time_s = _boot_s(forger.drone) + ahead_s if boot_s is None else boot_s
            return [forger.position(codec, height_m=height_m, boot_s=time_s)]

        return InsertedMessages(forge, every_s)

    return make


def _boot_s(drone: Drone) -> float:
    boot_s: float = drone.autopilot.boot_s
    return boot_s


def _sequence(frame: bytes) -> int:
    return frame[2] if frame[0] == 0xFE else frame[4]
