"""What a link, or somebody on it, may do to what a vehicle says, where each hostility is made by one function of a
speaker; and what may befall the vehicle itself, which is sound otherwise and hears everything that the ground sends."""

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

from app.simdrone.drone import Drone
from app.vehicles.mavlink.dialects import Codec, Dialect, FieldValue, Message, number

COMPANION: Final = 191
ONBOARD_CONTROLLER: Final = 18
QUADROTOR: Final = 2
NO_AUTOPILOT: Final = 8
POSITION: Final = "LOCAL_POSITION_NED"
SIGHTING: Final = "VISION_POSITION_ESTIMATE"
"""Of a second source of altitude."""
FIELDS: Final = ("x", "y", "z", "vx", "vy", "vz")
UNREAL: Final = (math.nan, math.inf, -math.inf)
TWINS_S: Final = (0.0, 0.4, 5.0, 3600.0)
GAPS_S: Final = (0.0, 0.3, 0.6, 1.0)
SHIFTS_M: Final = (0.1, 0.2, -0.1, -0.2)
MAKES: Final[Mapping[str, int]] = {"paparazzi": 9, "ardupilot": 3, "px4": 12}
BY_HAND: Final[Mapping[str, tuple[int, int]]] = {"paparazzi": (64, 0), "ardupilot": (1, 0), "px4": (1, 3 << 16)}
"""base_mode and custom_mode of a mode in which a person flies."""
HOVERING: Final[Mapping[str, tuple[int, int]]] = {
    "paparazzi": (4, 0),
    "ardupilot": (1, 4),
    "px4": (1, 3 << 24 | 4 << 16),
}


class Hostility(Protocol):
    """`arrive(frames, now_s)`: what arrives of the packets of one tick while it acts, s since the drone was on."""

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]: ...


@dataclass
class Speaker:
    """Says things as the vehicle, or as something else on board; reads what the vehicle says."""

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
        """The frame with other values in its fields, and its own sequence number, if it is of this kind."""
        message = self.read(frame)
        if message is None or message.get_type() != kind:
            return frame
        told = {name: getattr(message, name) for name in message.get_fieldnames()}
        codec = self.codec(self.own, _sequence(frame))
        return codec.pack(self.dialect.message(kind, {**told, **change(message)}))

    def heartbeat(
        self, codec: Codec, *, armed: bool, mode: tuple[int, int], kind: int = QUADROTOR, make: int | None = None
    ) -> bytes:
        base, custom = mode
        told = {
            "type": kind,
            "autopilot": MAKES[self.autopilot] if make is None else make,
            "base_mode": base | (128 if armed else 0),
            "custom_mode": custom,
            "system_status": 4,
            "mavlink_version": 3,
        }
        return codec.pack(self.dialect.message("HEARTBEAT", told))

    def position(self, codec: Codec, *, height_m: float, boot_s: float) -> bytes:
        told = dict.fromkeys(FIELDS, 0.0) | {"z": -height_m, "time_boot_ms": max(round(boot_s * 1000.0), 0)}
        return codec.pack(self.dialect.message(POSITION, told))


@dataclass
class Changed:
    """Every message of one kind carries other values."""

    speaker: Speaker
    kind: str
    change: Callable[[Message], Mapping[str, FieldValue]]

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:  # noqa: ARG002
        return [self.speaker.changed(frame, self.kind, self.change) for frame in frames]


@dataclass
class Silent:
    """One kind of message does not arrive."""

    speaker: Speaker
    kind: str

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:  # noqa: ARG002
        read = ((frame, self.speaker.read(frame)) for frame in frames)
        return [frame for frame, message in read if message is None or message.get_type() != self.kind]


@dataclass
class Frozen:
    """Every message of one kind says what the first one said, its time too."""

    speaker: Speaker
    kind: str
    _told: dict[str, FieldValue] = field(default_factory=dict)

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:  # noqa: ARG002
        return [self.speaker.changed(frame, self.kind, self._repeat) for frame in frames]

    def _repeat(self, message: Message) -> Mapping[str, FieldValue]:
        self._told = self._told or {name: getattr(message, name) for name in message.get_fieldnames()}
        return self._told


@dataclass
class Inserted:
    """`say(now_s)` is heard, too: once, or every so often."""

    say: Callable[[float], list[bytes]]
    every_s: float = math.inf
    _due_s: float = -math.inf

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        if now_s < self._due_s:
            return list(frames)
        self._due_s = now_s + self.every_s
        return [*frames, *self.say(now_s)]


@dataclass
class Late:
    """Every n-th packet comes `late_s` later; as copies, on time as well."""

    late_s: float
    every: int
    copies: bool
    _count: int = 0
    _held: list[tuple[float, bytes]] = field(default_factory=list)

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
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
class Slower:
    """Every packet comes later than the one before it, until all come `most_s` late."""

    growth: float
    most_s: float
    _since_s: float | None = None
    _held: list[tuple[float, bytes]] = field(default_factory=list)

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        self._since_s = now_s if self._since_s is None else self._since_s
        due_s = now_s + min(self.growth * (now_s - self._since_s), self.most_s)
        self._held += [(due_s, frame) for frame in frames]
        passed = [frame for at_s, frame in self._held if at_s <= now_s]
        self._held = [(at_s, frame) for at_s, frame in self._held if at_s > now_s]
        return passed


@dataclass
class Misplaced:
    """Its altitude is no number for a while, and then that of the ground."""

    speaker: Speaker
    gap_s: float
    _since_s: float | None = None

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        self._since_s = now_s if self._since_s is None else self._since_s
        place = {"z": math.nan} if now_s - self._since_s < self.gap_s else {"z": -0.1, "vz": 0.0}
        return [self.speaker.changed(frame, POSITION, lambda _: place) for frame in frames]


class Replaced:
    """This vehicle is not heard any more, and after `gap_s` another one with its ids is, which stands disarmed."""

    def __init__(self, speaker: Speaker, gap_s: float) -> None:
        self._twin, self._gap_s = Twin(speaker, 0.0), gap_s
        self._since_s: float | None = None

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        self._since_s = now_s if self._since_s is None else self._since_s
        both = self._twin.arrive(frames, now_s)
        return [] if now_s - self._since_s < self._gap_s else [frame for frame in both if frame not in frames]


class Twin:
    """Another vehicle with the same ids reports as often as this one: it stands disarmed, or flies at 2 m."""

    def __init__(self, speaker: Speaker, older_s: float, *, flies: bool = False) -> None:
        self._speaker, self._older_s, self._flies = speaker, older_s, flies
        self._codec = speaker.codec(speaker.own, speaker.chance.randrange(256))

    def arrive(self, frames: Sequence[bytes], now_s: float) -> list[bytes]:
        both: list[bytes] = []
        for frame in frames:
            both.append(frame)
            message = self._speaker.read(frame)
            if message is not None and message.get_type() == POSITION:
                boot_s = now_s + self._older_s
                height_m = 2.0 if self._flies else 0.1
                both.append(self._speaker.position(self._codec, height_m=height_m, boot_s=boot_s))
            elif message is not None and message.get_type() == "HEARTBEAT":
                mode = HOVERING[self._speaker.autopilot]
                both.append(self._speaker.heartbeat(self._codec, armed=self._flies, mode=mode))
        return both


Make = Callable[[Speaker], Hostility]


def _number(name: str, value: float) -> Make:
    return lambda speaker: Changed(speaker, POSITION, lambda _: {name: value})


def _higher(kind: str, by_m: float) -> Make:
    return lambda speaker: Changed(speaker, kind, lambda told: {"z": number(told, "z") - by_m})


def _silence(kind: str) -> Make:
    return lambda speaker: Silent(speaker, kind)


def _misplaced(gap_s: float) -> Make:
    return lambda speaker: Misplaced(speaker, gap_s)


def _twin(older_s: float) -> Make:
    return lambda speaker: Twin(speaker, older_s)


def _beat(*, every_s: float, armed: bool = False, by_hand: bool = False) -> Make:
    def make(speaker: Speaker) -> Hostility:
        codec = speaker.codec(speaker.own, speaker.chance.randrange(256))
        mode = (BY_HAND if by_hand else HOVERING)[speaker.autopilot]
        return Inserted(lambda _: [speaker.heartbeat(codec, armed=armed, mode=mode)], every_s)

    return make


def _companion(*, poses: bool) -> Make:
    """A companion computer's heartbeat, as it is or posing as an autopilot, with a position of its own."""

    def make(speaker: Speaker) -> Hostility:
        codec = speaker.codec(COMPANION)
        kind, maker = (QUADROTOR, None) if poses else (ONBOARD_CONTROLLER, NO_AUTOPILOT)

        def say(now_s: float) -> list[bytes]:
            beat = speaker.heartbeat(codec, armed=False, mode=(0, 0), kind=kind, make=maker)
            return [beat, speaker.position(codec, height_m=0.0, boot_s=now_s)]

        return Inserted(say, 0.5)

    return make


def _place(*, height_m: float, every_s: float, ahead_s: float = 0.0, boot_s: float | None = None) -> Make:
    """A position that is not the vehicle's, in its name; `boot_s`: always of that time."""

    def make(speaker: Speaker) -> Hostility:
        codec = speaker.codec(speaker.own, speaker.chance.randrange(256))

        def say(_now_s: float) -> list[bytes]:
            told_s = _boot_s(speaker.drone) + ahead_s if boot_s is None else boot_s
            return [speaker.position(codec, height_m=height_m, boot_s=told_s)]

        return Inserted(say, every_s)

    return make


HOSTILITIES: Final[Mapping[str, Make]] = {
    **{f"{name} {value}": _number(name, value) for name in FIELDS for value in UNREAL},
    "parameters nan": lambda speaker: Changed(speaker, "PARAM_VALUE", lambda _: {"param_value": math.nan}),
    "parameters wrong": lambda speaker: Changed(
        speaker, "PARAM_VALUE", lambda told: {"param_value": number(told, "param_value") + 1.0}
    ),
    "companion": _companion(poses=False),
    "companion as autopilot": _companion(poses=True),
    **{f"twin {older_s:g} s older": _twin(older_s) for older_s in TWINS_S},
    "flying twin": lambda speaker: Twin(speaker, 5.0, flies=True),
    "replaced after 1.3 s": lambda speaker: Replaced(speaker, 1.3),
    **{f"on the ground after {gap_s:g} s": _misplaced(gap_s) for gap_s in GAPS_S},
    "later and later, to 1 s": lambda _: Slower(0.8, 1.0),
    "later and later, to 2 s": lambda _: Slower(1.5, 2.0),
    "late by 0.4 s": lambda _: Late(0.4, every=3, copies=False),
    "late by 2 s": lambda _: Late(2.0, every=7, copies=False),
    "copies after 2 s": lambda _: Late(2.0, every=2, copies=True),
    "copies at once": lambda _: Late(0.0, every=1, copies=True),
    "an hour ahead": _place(height_m=0.1, every_s=1.0, ahead_s=3600.0),
    "reboot once": _place(height_m=0.1, every_s=math.inf, boot_s=0.2),
    "ground once": _place(height_m=0.1, every_s=math.inf, ahead_s=0.005),
    "ground every second": _place(height_m=0.1, every_s=1.0, ahead_s=0.005),
    "ceiling once": _place(height_m=9.0, every_s=math.inf, ahead_s=0.005),
    "disarmed once": _beat(every_s=math.inf),
    "disarmed every second": _beat(every_s=1.0),
    "by hand once": _beat(every_s=math.inf, armed=True, by_hand=True),
    **{
        f"no {kind}": _silence(kind)
        for kind in ("HEARTBEAT", POSITION, "SYS_STATUS", "COMMAND_ACK", "PARAM_VALUE", "EXTENDED_SYS_STATE")
    },
    **{f"altitude {by_m:+g} m": _higher(POSITION, by_m) for by_m in SHIFTS_M},
    "mocap nan": lambda speaker: Changed(speaker, SIGHTING, lambda _: {"z": math.nan}),
    "mocap 1 m higher": _higher(SIGHTING, 1.0),
    "mocap frozen": lambda speaker: Frozen(speaker, SIGHTING),
    "mocap silent": _silence(SIGHTING),
}
"""What a link does, by name."""

MISFORTUNES: Final[Mapping[str, tuple[str, float]]] = {
    "pilot": ("taken-over", math.inf),
    "pilot for 1 s": ("taken-over", 1.0),
    "pilot for 3 s": ("taken-over", 3.0),
    "deaf": ("deaf", math.inf),
    "carried away": ("carried-away", math.inf),
}
"""What befalls the vehicle itself, by name: a fault of the simulated drone, and how long it lasts at the most."""
PILOTS: Final = frozenset(name for name, (fault, _) in MISFORTUNES.items() if fault == "taken-over")
UPLINKS_S: Final[Mapping[str, float]] = {f"commands {late_s:g} s late": late_s for late_s in (0.6, 1.2, 2.0)}
"""How much later everything arrives that the ground sends, by name."""
HAZARDS: Final = (*HOSTILITIES, *UPLINKS_S, *MISFORTUNES)


def _boot_s(drone: Drone) -> float:
    boot_s: float = drone.autopilot.boot_s  # type: ignore[attr-defined]
    return boot_s


def _sequence(frame: bytes) -> int:
    return frame[2] if frame[0] == 0xFE else frame[4]
