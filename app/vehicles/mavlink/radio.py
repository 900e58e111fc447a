"""Speaking with one vehicle in its profile's terms: asking with repetitions, one request in flight, and listening."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from app.core.clock import Clock
from app.vehicles.mavlink.arming_checks import ArmingChecks
from app.vehicles.mavlink.dialects import Message, source_component
from app.vehicles.mavlink.events import (
    Action,
    ActionDone,
    ActionRefused,
    Battery,
    BlockEntered,
    CommandReply,
    Heartbeat,
    Measurement,
    PacketReceived,
    Parameter,
    Position,
    StatusText,
    VehicleEvent,
    Version,
)
from app.vehicles.mavlink.failures import HEARTBEATS_MISSED, MAX_WITNESS_GAP
from app.vehicles.mavlink.link import Link, Received
from app.vehicles.mavlink.profiles.base import Outgoing, Profile, Step, Target

REPLY_TIMEOUT_S: Final = 0.5
ATTEMPTS: Final = 5
_POSITIONS: Final = 1000
_SPOKEN: Final = 5


@dataclass(slots=True)
class VehicleMemory:
    """The latest of what a vehicle said; positions with the time of their receipt. `block` is the number of its flight
    plan's block."""

    heartbeat: Heartbeat | None = None
    heartbeat_s: float = float("-inf")
    disarmed_since_s: float | None = None
    """Since when every heartbeat has said so."""
    version: str = ""
    uid: str = ""
    block: int | None = None
    block_s: float = float("-inf")
    battery_v: float | None = None
    may_arm: bool | None = None
    arming_checks: ArmingChecks = field(default_factory=ArmingChecks)
    positions: deque[tuple[float, Position]] = field(default_factory=lambda: deque(maxlen=_POSITIONS))
    spoken: deque[str] = field(default_factory=lambda: deque(maxlen=_SPOKEN))
    _piece_of: int = 0
    _pieces: str = ""

    def forget_vehicle(self) -> None:
        """Who it is, and what its own checks found."""
        self.version = self.uid = ""
        self.arming_checks = ArmingChecks()

    def note(self, measurement: Measurement | None, now_s: float) -> None:
        match measurement:
            case Heartbeat(armed=armed):
                self.heartbeat, self.heartbeat_s = measurement, now_s
                since_s = now_s if self.disarmed_since_s is None else self.disarmed_since_s
                self.disarmed_since_s = None if armed else since_s
            case Version(version=version, uid=uid):
                self.version, self.uid = version or self.version, uid or self.uid
            case BlockEntered(number=number):
                self.block, self.block_s = number, now_s
            case Battery(voltage_v=volts, may_arm=may_arm):
                self.battery_v = volts if volts is not None else self.battery_v
                self.may_arm = may_arm
            case VehicleEvent():
                self.arming_checks.take(measurement)
            case Position():
                self.positions.append((now_s, measurement))
            case StatusText():
                self._hear(measurement)
            case _:
                pass

    def _hear(self, said: StatusText) -> None:
        """Pieces are put together in their order; one that is lost is not waited for."""
        if said.number != self._piece_of or said.place == 0:
            self._piece_of, self._pieces = said.number, ""
        self._pieces += said.text
        if said.is_last:
            self.spoken.append(self._pieces)
            self._piece_of, self._pieces = 0, ""


class AutopilotLink:
    """A link with a profile; an answer is waited for `patience_s`. Only the autopilot's own component is listened to;
    `overhear` gets every message besides, of whichever. Whatever waits for the vehicle `listen`s: `on_wait` is told
    then of what came, every `patience_s` at least, and what it raises ends what is under way. For one thread."""

    def __init__(
        self,
        link: Link,
        profile: Profile,
        clock: Clock,
        aim: Target,
        *,
        patience_s: float = REPLY_TIMEOUT_S,
        overhear: Callable[[Received], None] | None = None,
        on_wait: Callable[[list[PacketReceived]], None] = lambda _heard: None,
    ) -> None:
        self.link: Final = link
        self.profile: Final = profile
        self.clock: Final = clock
        self.aim = aim
        self.patience_s: Final = patience_s
        self.seen: Final = VehicleMemory()
        self._overhear = overhear
        self._on_wait = on_wait

    @property
    def timeout_factor(self) -> float:
        """How many times longer than a real vehicle this one is waited for."""
        return self.patience_s / REPLY_TIMEOUT_S

    @property
    def silence_s(self) -> float:
        """A vehicle that has sent no heartbeat for so long is not there."""
        return HEARTBEATS_MISSED * self.profile.heartbeat_s * self.timeout_factor

    @property
    def is_disarmed(self) -> bool:
        """By two heartbeats at least, and none between them that says otherwise."""
        seen = self.seen
        return seen.disarmed_since_s is not None and seen.heartbeat_s - seen.disarmed_since_s >= self.witness_gap_s

    @property
    def witness_gap_s(self) -> float:
        """How far two heartbeats must be apart to be two witnesses."""
        return MAX_WITNESS_GAP * self.profile.heartbeat_s * self.timeout_factor

    @property
    def block(self) -> str:
        """The block of its flight plan that the vehicle is in, by name; empty where it does not tell."""
        names = {number: name for name, number in self.aim.blocks.items()}
        return "" if self.seen.block is None else names.get(self.seen.block, f"block {self.seen.block}")

    def send(self, *messages: Outgoing) -> None:
        """Raises LinkError when the link is closed."""
        for message in messages:
            self.link.send(message.kind, **message.fields)

    def listen(self, timeout_s: float) -> list[PacketReceived]:
        """As `receive`, on behalf of what takes time: raises whatever `on_wait` does."""
        heard = self.receive(timeout_s)
        self._on_wait(heard)
        return heard

    def receive(self, timeout_s: float) -> list[PacketReceived]:
        """What has come since the last call, waiting at most so long for the first. Raises LinkError as `send`."""
        messages = self.link.receive(timeout_s)
        if self._overhear is not None:
            for message in messages:
                self._overhear(message)
        heard = [
            PacketReceived(self.profile.measure(received.message), received.received_s)
            for received in messages
            if self._is_autopilots(received.message)
        ]
        for each in heard:
            if isinstance(each.measurement, Heartbeat):
                self._forget_absent(each.now_s)
            self.seen.note(each.measurement, each.now_s)
        return heard

    def hear_pending(self) -> None:
        """Take in what has come, and forget who a vehicle is that is not there."""
        self.listen(0.0)
        self._forget_absent(self.clock.now_s())

    def _forget_absent(self, now_s: float) -> None:
        """Another may come in its place."""
        if now_s - self.seen.heartbeat_s > self.silence_s:
            self.seen.forget_vehicle()

    def _is_autopilots(self, message: Message) -> bool:
        """Not of another component on board; of any while the autopilot's is not known."""
        return self.aim.component in (0, source_component(message))

    def request(
        self, request: Outgoing, fits: Callable[[Measurement], bool], *, attempts: int = ATTEMPTS
    ) -> Measurement | None:
        """The answer to a request that is repeated every 0.5 s; None when there is none. Raises LinkError."""
        self.listen(0.0)
        for _ in range(attempts):
            self.send(request)
            until_s = self.clock.now_s() + self.patience_s
            while (left_s := until_s - self.clock.now_s()) > 0.0:
                for heard in self.listen(left_s):
                    if heard.measurement is not None and fits(heard.measurement):
                        return heard.measurement
        return None

    def set_up(self, steps: tuple[Step, ...]) -> str:
        """Carry out steps on the ground, waiting for them; why they were refused, or nothing. Raises LinkError."""
        conversation = CommandSequence(Action.ARM, steps, self, description="be set up")
        while True:
            ended = conversation.proceed(self.listen(self.patience_s / 10.0))
            if ended is not None:
                return ended.why if isinstance(ended, ActionRefused) else ""


class CommandSequence:
    """Steps under way: each begins when the one before it was answered; nothing here waits. `description` says what the
    vehicle was told, where that is not the action."""

    def __init__(self, action: Action, steps: tuple[Step, ...], radio: AutopilotLink, *, description: str = "") -> None:
        self._action, self._radio, self._told = action, radio, description or action
        self._steps = list(steps)
        self._sent_s = 0.0
        self._attempts = 0
        self._send()

    def proceed(self, heard: list[PacketReceived]) -> ActionDone | ActionRefused | None:
        """Take in what came and send what is due; how it ended, once it has."""
        for each in heard:
            if self._steps and (accepted := _verdict(self._steps[0], each.measurement)) is not None:
                if not accepted and self._steps[0].needed:
                    return self._refused(each.measurement)
                self._next()
        now_s = self._radio.clock.now_s()
        while self._steps and not self._steps[0].awaits and now_s - self._sent_s >= self._steps[0].pause_s:
            self._next()
        if not self._steps:
            return ActionDone(self._action, now_s)
        if self._steps[0].awaits and now_s - self._sent_s >= self._radio.patience_s:
            if self._attempts < self._steps[0].attempts:
                self._send()
            elif not self._steps[0].needed:
                self._next()
            elif self._steps[0].attempts > 1:
                return self._unanswered()
        return None

    def _next(self) -> None:
        self._steps.pop(0)
        self._attempts = 0
        self._send()

    def _send(self) -> None:
        if self._steps:
            self._sent_s = self._radio.clock.now_s()
            self._attempts += 1
            self._radio.send(*self._steps[0].sends)

    def _refused(self, measurement: Measurement | None) -> ActionRefused:
        why = measurement.why if isinstance(measurement, CommandReply) else ""
        said = f" It said: {' / '.join(self._radio.seen.spoken)}." if self._radio.seen.spoken else ""
        return ActionRefused(
            self._action, f"The vehicle refused to {self._told} ({why}).{said}", self._radio.clock.now_s()
        )

    def _unanswered(self) -> ActionRefused:
        why = f"The vehicle did not answer when it was to {self._told}."
        return ActionRefused(self._action, why, self._radio.clock.now_s())


def _verdict(step: Step, measurement: Measurement | None) -> bool | None:
    """Whether what was heard ends the step, and how; None when it is no answer to it."""
    match measurement:
        case CommandReply(to=to, accepted=accepted) if to == step.awaits:
            return accepted
        case Parameter(name=name) if name == step.awaits:
            return True
        case _:
            return None
