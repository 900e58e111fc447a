"""Communication with one vehicle by its profile: repeated requests, one in flight at a time, and reception."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from app.autopilots.autopilot import ArmingChecks, Autopilot, AutopilotError, HoverLimits, ReferenceSource
from app.autopilots.commands import TARGET, Action, Outgoing, Step, Target
from app.autopilots.dialects import Message, source_component
from app.autopilots.measurements import (
    AltitudeError,
    Battery,
    BlockEntered,
    CommandReply,
    Heartbeat,
    LandedState,
    Measurement,
    Parameter,
    Position,
    StatusText,
    TargetAltitude,
    Throttle,
    VehicleEvent,
    Version,
)
from app.core.clock import Clock
from app.core.records.trajectory import THROTTLE_HOLDS_S
from app.vehicles.base import Condition, VehicleError
from app.vehicles.mavlink.boot_clock import RestartCounter
from app.vehicles.mavlink.events import ActionDone, ActionRefused, PacketReceived
from app.vehicles.mavlink.failures import CONFIRMATION_PERIODS, HEARTBEATS_MISSED
from app.vehicles.mavlink.link import Link, LinkHealth, Received

REPLY_TIMEOUT_S: Final = 0.5
ATTEMPTS: Final = 5
_POSITIONS: Final = 1000
_STATUS_TEXTS: Final = 5
RATE_OVER_S: Final = 2.0
LOSS_OVER_S: Final = 10.0
_COUNT_EVERY_S: Final = 1.0
_MAX_AGE_S: Final = 2.0
_JUST_HEARD_S: Final = 0.1
_PAUSE_S: Final = 0.2
_REFERENCE_HOLDS_S: Final = 0.25
"""Greatest age of a report of the autopilot's reference."""
_SAME_TARGET_M: Final = 0.01
_REFERENCE_TAKES_S: Final = 4.0
"""Least time in which a flight plan sets its ground reference: 10 s in the stock plans, but fewer by the clock of the
ground if a simulation is fast, or reports arrive again late."""


@dataclass(slots=True)
class LoopReports:
    """Latest reports of a vehicle's vertical loop, with their times of receipt."""

    throttle: float | None = None
    throttle_s: float = float("-inf")
    exact_throttle_s: float = float("-inf")
    altitude_error_m: float = 0.0
    altitude_error_s: float = float("-inf")
    target_m: float = 0.0
    target_s: float = float("-inf")

    def throttle_at(self, now_s: float) -> float | None:
        """Return the throttle last reported, as a share of full; None without a recent report."""
        return self.throttle if now_s - self.throttle_s <= THROTTLE_HOLDS_S else None

    def reference_at(self, source: ReferenceSource, altitude_m: float, now_s: float) -> float | None:
        """Return the autopilot's own reference of a vehicle at this altitude; None without a recent report."""
        if source == "error" and now_s - self.altitude_error_s <= _REFERENCE_HOLDS_S:
            return altitude_m + self.altitude_error_m
        return self.target_m if source == "target" and now_s - self.target_s <= _REFERENCE_HOLDS_S else None

    def note(self, measurement: Measurement | None, now_s: float) -> None:
        """Note what is reported of the vertical loop: a less exact throttle only while no exact one arrives."""
        match measurement:
            case Throttle(share=share, exact=exact):
                self.exact_throttle_s = now_s if exact else self.exact_throttle_s
                if exact or now_s - self.exact_throttle_s > THROTTLE_HOLDS_S:
                    self.throttle, self.throttle_s = share, now_s
            case AltitudeError(error_m=error_m):
                self.altitude_error_m, self.altitude_error_s = error_m, now_s
            case TargetAltitude(altitude_m=altitude_m):
                self.target_m, self.target_s = altitude_m, now_s
            case _:
                pass


@dataclass(slots=True)
class VehicleMemory:
    """Latest measurements of a vehicle; positions with their time of receipt. `block` is the number of the current
    block of its flight plan."""

    heartbeat: Heartbeat | None = None
    heartbeat_s: float = float("-inf")
    agreed_since_s: float = float("-inf")
    """Since when every heartbeat has reported the same of its motors, armed or disarmed."""
    version: str = ""
    uid: str = ""
    block: int | None = None
    block_s: float = float("-inf")
    has_ground_reference: bool = False
    """Whether its flight plan was heard to set its ground reference, and it has not restarted since."""
    battery_v: float | None = None
    loop: LoopReports = field(default_factory=LoopReports)
    reports_landing: bool = False
    """Whether it has sent its landed state."""
    may_arm: bool | None = None
    """Whether it reports that it may be armed in its mode; None if it never reports that. One that has done so, or that
    sends events, may not while it reports nothing."""
    arming_checks: ArmingChecks = field(default_factory=ArmingChecks)
    positions: deque[tuple[float, Position]] = field(default_factory=lambda: deque(maxlen=_POSITIONS))
    restart_counter: RestartCounter = field(default_factory=RestartCounter)
    status_texts: deque[str] = field(default_factory=lambda: deque(maxlen=_STATUS_TEXTS))
    status_text_s: float | None = None
    _piece_of: int = 0
    _pieces: str = ""

    @property
    def restarts(self) -> int:
        """Number of times that the vehicle has restarted since it was connected."""
        return self.restart_counter.restarts

    def forget_vehicle(self) -> None:
        """Discard its identity, the results of its arming checks and its ground reference."""
        self.version = self.uid = ""
        self.may_arm = None
        self.has_ground_reference = False
        self.arming_checks = type(self.arming_checks)()

    def note(self, measurement: Measurement | None, now_s: float) -> None:
        self.reports_landing |= isinstance(measurement, LandedState)
        match measurement:
            case Heartbeat(armed=armed):
                if self.heartbeat is None or self.heartbeat.armed != armed:
                    self.agreed_since_s = now_s
                self.heartbeat, self.heartbeat_s = measurement, now_s
            case Version(version=version, uid=uid):
                self.version, self.uid = version or self.version, uid or self.uid
            case BlockEntered(number=number):
                self.block, self.block_s = number, now_s
            case Battery(voltage_v=volts, may_arm=may_arm):
                self.battery_v = volts if volts is not None else self.battery_v
                self.may_arm = False if may_arm is None and self.may_arm is not None else may_arm
            case Throttle() | AltitudeError() | TargetAltitude():
                self.loop.note(measurement, now_s)
            case VehicleEvent():
                self.arming_checks.take(measurement)
                self.may_arm = bool(self.may_arm)
            case Position():
                self.positions.append((now_s, measurement))
                before = self.restarts
                self.restart_counter.take(measurement, now_s)
                self.has_ground_reference &= self.restarts == before
            case StatusText():
                self._add_chunk(measurement, now_s)
            case _:
                pass

    def _add_chunk(self, chunk: StatusText, now_s: float) -> None:
        """Assemble the chunks of a status text in order; a lost chunk is not waited for."""
        if chunk.number != self._piece_of or chunk.place == 0:
            self._piece_of, self._pieces = chunk.number, ""
        self._pieces += chunk.text
        if chunk.is_last:
            self.status_texts.append(self._pieces)
            self.status_text_s = now_s
            self._piece_of, self._pieces = 0, ""


class AutopilotLink:
    """Link to an autopilot by its profile, for use by one thread.

    Replies are waited for `reply_timeout_s`. Only messages of the autopilot's own component are measured; `on_message`
    is called with every message of any component. Operations that wait for the vehicle call `listen`, which calls
    `on_wait` with the packets received, at least every `reply_timeout_s`; an exception from it ends the operation.
    """

    def __init__(
        self,
        link: Link,
        profile: Autopilot,
        clock: Clock,
        target: Target,
        *,
        reply_timeout_s: float = REPLY_TIMEOUT_S,
        on_message: Callable[[Received], None] | None = None,
        on_wait: Callable[[list[PacketReceived]], None] = lambda _packets: None,
    ) -> None:
        self.link: Final = link
        self.profile: Final = profile
        self.clock: Final = clock
        self.target = target
        self.reply_timeout_s: Final = reply_timeout_s
        self.seen: Final = VehicleMemory(arming_checks=profile.arming_checks())
        self.paused_until_s = float("-inf")
        """End of the last time in which nothing was received because this program stalled: what arrives then is old."""
        self._listened_s = clock.now_s()
        self._on_message = on_message
        self._on_wait = on_wait

    @property
    def timeout_factor(self) -> float:
        """Factor on the timeouts of a real vehicle."""
        return self.reply_timeout_s / REPLY_TIMEOUT_S

    @property
    def silence_s(self) -> float:
        """Time without a heartbeat after which the vehicle counts as absent, s."""
        return HEARTBEATS_MISSED * self.profile.heartbeat_s * self.timeout_factor

    @property
    def is_disarmed(self) -> bool:
        """Whether it is disarmed by at least two heartbeats with none between them that contradicts."""
        return self._heartbeats_agree and self.seen.heartbeat is not None and not self.seen.heartbeat.armed

    @property
    def is_armed(self) -> bool:
        """Whether it is armed by at least two heartbeats with none between them that contradicts."""
        return self._heartbeats_agree and self.seen.heartbeat is not None and self.seen.heartbeat.armed

    @property
    def _heartbeats_agree(self) -> bool:
        return self.seen.heartbeat_s - self.seen.agreed_since_s >= self.confirmation_s

    @property
    def confirmation_s(self) -> float:
        """Minimum time between two heartbeats that confirm each other, s."""
        return CONFIRMATION_PERIODS * self.profile.heartbeat_s * self.timeout_factor

    def _note_ground_reference(self, entered: int, now_s: float) -> None:
        """Note whether the flight plan has set its ground reference: it has if it enters the last of those blocks from
        the one before, and was in that for its full time, because a command may end it earlier."""
        seen, numbers = self.seen, [self.target.blocks.get(name) for name in self.profile.ground_blocks]
        has_passed = [seen.block, entered] == numbers[-2:] and now_s - seen.block_s >= _REFERENCE_TAKES_S
        seen.has_ground_reference = has_passed or (seen.has_ground_reference and entered not in numbers[:-1])

    @property
    def block(self) -> str:
        """Name of the current block of its flight plan; empty if not reported."""
        names = {number: name for name, number in self.target.blocks.items()}
        return "" if self.seen.block is None else names.get(self.seen.block, f"block {self.seen.block}")

    def explore(self) -> Mapping[str, int]:
        """Return the blocks of its flight plan, if there is one. Raises VehicleError if a required one is missing."""
        try:
            return self.profile.explore(self.request, self.target)
        except AutopilotError as error:
            raise VehicleError(error.message, hint=error.hint) from error

    def hover_limits(self, parameters: Mapping[str, float]) -> HoverLimits | None:
        """Return those of `Autopilot.hover_limits`. Raises VehicleError for a parameter out of its range."""
        try:
            return self.profile.hover_limits(parameters)
        except AutopilotError as error:
            raise VehicleError(error.message, hint=error.hint) from error

    def send(self, *messages: Outgoing) -> None:
        """Send messages. Raises LinkError if the link is closed."""
        for message in messages:
            self.link.send(message.kind, **message.fields)

    def listen(self, timeout_s: float) -> list[PacketReceived]:
        """Receive during an operation that waits; raises as `receive` and `on_wait` do."""
        packets = self.receive(timeout_s)
        self._on_wait(packets)
        return packets

    def receive(self, timeout_s: float) -> list[PacketReceived]:
        """Return the packets since the last call, waiting at most `timeout_s` for the first. Raises LinkError as
        `send` does."""
        is_paused = self.clock.now_s() - self._listened_s > _PAUSE_S
        messages = self.link.receive(timeout_s)
        self._listened_s = self.clock.now_s()
        if is_paused:
            self.paused_until_s = self._listened_s + _JUST_HEARD_S
        if self._on_message is not None:
            for message in messages:
                self._on_message(message)
        packets = [
            PacketReceived(self.profile.measure(received.message), received.received_s)
            for received in messages
            if self._is_autopilots(received.message)
        ]
        for each in packets:
            if isinstance(each.measurement, Heartbeat):
                self._forget_absent(each.now_s)
            if isinstance(each.measurement, BlockEntered):
                self._note_ground_reference(each.measurement.number, each.now_s)
            self.seen.note(each.measurement, each.now_s)
        return packets

    def receive_pending(self) -> None:
        """Process the packets that have arrived, and discard the identity of an absent vehicle."""
        self.listen(0.0)
        self._forget_absent(self.clock.now_s())

    def _forget_absent(self, now_s: float) -> None:
        """Discard the identity after an absence, because another vehicle may take its place."""
        if now_s - self.seen.heartbeat_s > self.silence_s:
            self.seen.forget_vehicle()

    def _is_autopilots(self, message: Message) -> bool:
        """Whether the message is of the autopilot's component, or of any while that is unknown."""
        return self.target.component in (0, source_component(message))

    def request(
        self, request: Outgoing, fits: Callable[[Measurement], bool], *, attempts: int = ATTEMPTS
    ) -> Measurement | None:
        """Send a request every 0.5 s until a reply fits; return it, or None without a reply. Raises LinkError."""
        self.listen(0.0)
        for _ in range(attempts):
            self.send(request)
            until_s = self.clock.now_s() + self.reply_timeout_s
            while (left_s := until_s - self.clock.now_s()) > 0.0:
                for packet in self.listen(left_s):
                    if packet.measurement is not None and fits(packet.measurement):
                        return packet.measurement
        return None

    def set_up(self, steps: tuple[Step, ...]) -> str:
        """Carry out steps on the ground and wait for them; return why they were refused, or an empty string. Raises
        LinkError."""
        conversation = CommandSequence(Action.ARM, steps, self, description="be set up")
        while True:
            ended = conversation.proceed(self.listen(self.reply_timeout_s / 10.0))
            if ended is not None:
                return ended.why if isinstance(ended, ActionRefused) else ""


class CommandSequence:
    """Steps in progress: each begins when the previous one was acknowledged; no method waits. `description` names the
    steps in messages, by default by the action."""

    def __init__(self, action: Action, steps: tuple[Step, ...], radio: AutopilotLink, *, description: str = "") -> None:
        self._action, self._radio, self._description = action, radio, description or action
        self._steps = list(steps)
        self._sent_s: list[float] = []
        self._replied_s: float | None = None
        self._begun_s = radio.clock.now_s()
        self._send()

    def proceed(self, packets: list[PacketReceived]) -> ActionDone | ActionRefused | None:
        """Process packets and send the next messages; return the result once the sequence has ended. Packets received
        before the messages were sent are no replies to them."""
        for each in packets:
            if (
                self._steps
                and self._sent_s
                and each.now_s >= self._begun_s
                and (accepted := self._verdict(each.measurement)) is not None
            ):
                if not accepted and self._steps[0].needed:
                    return self._refused(each.measurement)
                self._replied_s = each.now_s
                self._next(each.now_s)
        now_s = self._radio.clock.now_s()
        while self._steps and not self._steps[0].awaits and now_s - self._begun_s >= self._steps[0].pause_s:
            self._next(now_s)
        if not self._steps:
            return ActionDone(self._action, now_s, tuple(self._sent_s), self._replied_s)
        return self._send_again(now_s)

    def _send_again(self, now_s: float) -> ActionRefused | None:
        """Send messages that were withheld until now, or that were not answered; return the result if they may not be
        repeated."""
        step = self._steps[0]
        if not self._sent_s:
            self._send()
        elif step.awaits and now_s - self._sent_s[-1] >= self._radio.reply_timeout_s:
            if len(self._sent_s) < step.attempts:
                self._send()
            elif not step.needed:
                self._next(now_s)
            elif step.attempts > 1:
                return self._unanswered()
        return None

    def _verdict(self, measurement: Measurement | None) -> bool | None:
        """Return whether a reply accepts the step; None if it is not one to it, or a refusal that is not final."""
        step = self._steps[0]
        accepted = _verdict(step, measurement)
        is_final = not step.persists or len(self._sent_s) >= step.attempts
        return accepted if accepted or is_final else None

    def _next(self, replied_s: float) -> None:
        """Begin the next step. One that sends nothing awaits what follows the previous reply."""
        self._steps.pop(0)
        if self._steps:
            self._sent_s, self._replied_s = [], None
            self._begun_s = replied_s
            self._send()

    def _send(self) -> None:
        if self._steps and self._may_send(self._steps[0]):
            now_s = self._radio.clock.now_s()
            if self._steps[0].sends and not self._sent_s:
                self._begun_s = now_s
            self._sent_s.append(now_s)
            self._radio.send(*self._steps[0].sends)

    def _may_send(self, step: Step) -> bool:
        """Whether a heartbeat that has just arrived reports one of the modes in which the step may be sent: since an
        older one, a pilot may have taken over."""
        seen = self._radio.seen
        if not step.modes:
            return True
        is_new = self._radio.clock.now_s() - seen.heartbeat_s <= _JUST_HEARD_S * self._radio.timeout_factor
        is_new = is_new and seen.heartbeat_s > self._radio.paused_until_s
        return is_new and seen.heartbeat is not None and seen.heartbeat.mode in step.modes

    def _refused(self, measurement: Measurement | None) -> ActionRefused:
        why = measurement.why if isinstance(measurement, CommandReply) else ""
        texts = f" Its messages: {' / '.join(self._radio.seen.status_texts)}." if self._radio.seen.status_texts else ""
        return ActionRefused(
            self._action, f"The vehicle refused to {self._description} ({why}).{texts}", self._radio.clock.now_s()
        )

    def _unanswered(self) -> ActionRefused:
        why = f"The vehicle did not reply to the command to {self._description}."
        return ActionRefused(self._action, why, self._radio.clock.now_s())


def _verdict(step: Step, measurement: Measurement | None) -> bool | None:
    """Return whether a reply accepts the step; None if it is not a reply to it."""
    match measurement:
        case CommandReply(to=to, accepted=accepted) if to == step.awaits:
            return accepted
        case Parameter(name=name) if name == step.awaits:
            return True
        case Heartbeat(mode=mode) if f"mode {mode}" in (step.awaits, step.shown_by):
            return True
        case TargetAltitude(altitude_m=altitude_m) if step.awaits == TARGET:
            return True if abs(altitude_m - step.altitude_m) < _SAME_TARGET_M else None
        case _:
            return None


@dataclass(frozen=True, slots=True)
class _Count:
    at_s: float
    received: int
    lost: int


class StatusReader:
    """Reads the state of a vehicle without sending or waiting. Losses are counted over about the last ten seconds."""

    def __init__(self, radio: AutopilotLink) -> None:
        self._radio = radio
        opened = _Count(radio.clock.now_s(), 0, 0)
        self._counts: deque[_Count] = deque([opened], maxlen=round(LOSS_OVER_S / _COUNT_EVERY_S) + 1)

    def read(self, *, step: str, datum_m: float, held: Mapping[str, float], trouble: str) -> Condition:
        """Return the current state; altitude counts from `datum_m` on the vehicle's own datum."""
        radio, now_s = self._radio, self._radio.clock.now_s()
        health, heartbeat = radio.link.health, radio.seen.heartbeat
        recent = [(at_s, position) for at_s, position in radio.seen.positions if now_s - at_s <= RATE_OVER_S]
        last = recent[-1][1] if recent and now_s - recent[-1][0] < _MAX_AGE_S else None
        return Condition(
            step=step,
            packet_age_s=_age(now_s, health.last_packet_s),
            heartbeat_age_s=_age(now_s, health.last_heartbeat_s),
            armed=None if heartbeat is None else heartbeat.armed,
            mode="" if heartbeat is None else self._mode(heartbeat.mode),
            altitude_m=None if last is None else last.altitude_m - datum_m,
            climb_rate_m_s=None if last is None else last.climb_rate_m_s,
            battery_v=radio.seen.battery_v,
            position_hz=len(recent) / RATE_OVER_S,
            lost_share=self._lost_share(now_s, health),
            held=dict(held),
            said=radio.seen.status_texts[-1] if radio.seen.status_texts else "",
            said_age_s=_age(now_s, radio.seen.status_text_s),
            trouble=trouble,
            restarts=radio.seen.restarts,
        )

    def _mode(self, number: str) -> str:
        """Return the display name of the mode, or of the block if the vehicle flies by a flight plan."""
        profile = self._radio.profile
        name = profile.mode_names.get(number, number)
        return name if number in profile.modes_without_land else self._radio.block or name

    def _lost_share(self, now_s: float, health: LinkHealth) -> float | None:
        if now_s - self._counts[-1].at_s >= _COUNT_EVERY_S:
            self._counts.append(_Count(now_s, health.received, health.lost))
        first = self._counts[0]
        lost, received = health.lost - first.lost, health.received - first.received
        return lost / (lost + received) if lost + received else None


def _age(now_s: float, then_s: float | None) -> float | None:
    return None if then_s is None else max(now_s - then_s, 0.0)
