"""Communication with one vehicle by its profile: opening of its link by its options, repeated requests, one in flight
at a time, and reception.
"""

import datetime as dt
from collections.abc import Callable
from pathlib import Path
from typing import Final

from app.autopilots.autopilot import Autopilot
from app.autopilots.commands import Outgoing, Target
from app.autopilots.dialects import read_key, source_component
from app.autopilots.measurements import BlockEntered, Heartbeat, Measurement
from app.autopilots.registry import AUTOPILOTS
from app.core.clock import Clock
from app.vehicles.kinds import Options
from app.vehicles.mavlink import addresses
from app.vehicles.mavlink.events import PacketReceived
from app.vehicles.mavlink.failures import CONFIRMATION_PERIODS, HEARTBEATS_MISSED
from app.vehicles.mavlink.link import Link, Received
from app.vehicles.mavlink.memory import VehicleMemory
from app.vehicles.mavlink.transports import Transport

REPLY_TIMEOUT_S: Final = 0.5
ATTEMPTS: Final = 5
JUST_HEARD_S: Final = 0.1
LISTEN_S: Final = 0.1
"""Longest time for which an operation that waits receives at a go."""
HEARTBEAT_WITHIN_S: Final = 5.0
"""Time within which a vehicle that is on is heard."""
TAKEOFF_ALTITUDE_M: Final = 3.0
MAX_UNSCALED_SPEED: Final = 4.0
"""Up to this clock speed the timeouts of a simulated vehicle are those of a real one. Beyond, they are longer by its
clock, because the pauses of a busy computer are in wall time."""
_PAUSE_S: Final = 0.2
_REFERENCE_TAKES_S: Final = 4.0
"""Least time in which a flight plan sets its ground reference: 10 s in the stock plans, but fewer by the clock of the
ground if a simulation is fast, or reports arrive again late."""


class AutopilotLink:
    """Link to an autopilot by its profile, for use by one thread.

    Replies are waited for `reply_timeout_s`. Only messages of the autopilot's own component are measured, or of any
    while that is unknown; `on_message` is called with every message of any component. Operations that wait for the
    vehicle call `listen`, which calls `on_wait` with the packets received, at least every `reply_timeout_s`; an
    exception from it ends the operation.
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
    def reports_armed(self) -> bool:
        """Whether its last heartbeat reports that it is armed; `is_armed` takes two."""
        return self.seen.heartbeat is not None and self.seen.heartbeat.armed

    @property
    def is_disarmed(self) -> bool:
        """Whether it is disarmed by at least two heartbeats with none between them that contradicts."""
        return self._heartbeats_agree and self.seen.heartbeat is not None and not self.seen.heartbeat.armed

    @property
    def is_armed(self) -> bool:
        """Whether it is armed by at least two heartbeats with none between them that contradicts."""
        return self._heartbeats_agree and self.reports_armed

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
            self.paused_until_s = self._listened_s + JUST_HEARD_S
        if self._on_message is not None:
            for message in messages:
                self._on_message(message)
        packets = [
            PacketReceived(self.profile.measure(received.message), received.received_s)
            for received in messages
            if self.target.component in (0, source_component(received.message))
        ]
        for each in packets:
            if isinstance(each.measurement, Heartbeat):
                self.forget_absent(each.now_s)
            if isinstance(each.measurement, BlockEntered):
                self._note_ground_reference(each.measurement.number, each.now_s)
            self.seen.note(each.measurement, each.now_s)
        return packets

    def forget_absent(self, now_s: float) -> None:
        """Discard the identity after an absence, because another vehicle may take its place."""
        if now_s - self.seen.heartbeat_s > self.silence_s:
            self.seen.forget_vehicle()

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


def open_radio(
    options: Options,
    clock: Clock,
    *,
    on_message: Callable[[Received], None] | None,
    on_wait: Callable[[list[PacketReceived]], None] = lambda _packets: None,
    is_silent: Callable[[], bool] = lambda: False,
    transport: Transport | None = None,
) -> AutopilotLink:
    """Open the link to a vehicle.

    `clock` is the vehicle's time; for `on_message` and `on_wait` see AutopilotLink; no heartbeats are sent while
    `is_silent` returns true; `transport` replaces the address and the thread that reads it. Raises LinkError if the
    link or its log cannot be opened, InputError for a signing key that cannot be read or used.
    """
    profile = AUTOPILOTS[str(options["autopilot"])]
    key_file, log_folder = str(options["signing_key_file"]), str(options["log_folder"])
    log_name = f"{dt.datetime.now(dt.UTC):%Y%m%dT%H%M%S.%f}.tlog"  # a new one for every opening
    link = Link(
        addresses.parse(str(options["address"])),
        profile.dialect,
        clock=clock,
        target_system=int(options["system_id"]) or None,
        make=profile.autopilot,
        tlog=Path(log_folder) / log_name if log_folder else None,
        signing_key=read_key(Path(key_file)) if key_file else None,
        transport=transport,
        is_silent=is_silent,
    )
    target = Target(
        system=0,
        aircraft=int(options["aircraft_id"]),
        waypoint=int(options["climb_waypoint"]),
        altitude_m=TAKEOFF_ALTITUDE_M,
    )
    return AutopilotLink(
        link,
        profile,
        clock,
        target,
        reply_timeout_s=REPLY_TIMEOUT_S * max(1.0, float(options["clock_speed"]) / MAX_UNSCALED_SPEED),
        on_message=on_message,
        on_wait=on_wait,
    )
