"""A vehicle on the ground before a flight: where it stands and how it is received; and its preparation: a mode in which
it arms, its ground reference, a way to stop its motors. What changes it is sent only once it is certainly disarmed.
"""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from app.autopilots import commands
from app.autopilots.measurements import DISARMING, CommandReply, Heartbeat, Position
from app.vehicles.base import SafeGainsError
from app.vehicles.mavlink.altitude_sources import AltitudeSource
from app.vehicles.mavlink.radio import HEARTBEAT_WITHIN_S, LISTEN_S, AutopilotLink
from app.vehicles.mavlink.sent_commands import set_up

WATCHED_S: Final = 2.0
STANDS_WITHIN_M: Final = 0.3
ARMED: Final = "The vehicle is armed: either somebody else armed it, or a flight was interrupted."
LAND_FIRST: Final = "Land it, check that its motors have stopped, then verify its gains and release it."
ONE_VEHICLE: Final = "Switch the other vehicle off, or give each its own id."
_RATE_OVER_S: Final = 10.0
_BATTERY_S: Final = 10.0
_GOES_ON_S: Final = 1.0
_IRREGULAR: Final = 0.25
"""Some autopilots send at intervals that differ by half: a position is lost from 1.75 intervals on."""
_REFERENCE_WITHIN_S: Final = 13.0
"""Time from a position on within which a flight plan sets its ground reference; 10 s in the stock plans."""


@dataclass(frozen=True, slots=True)
class GroundObservation:
    """Messages of a vehicle on the ground within `seconds`; `secondary_m` are its altitudes from a second source, on
    that one's datum."""

    positions: tuple[Position, ...]
    seconds: float
    secondary_m: tuple[float, ...] = ()
    disarmed: bool = False
    """Whether there were heartbeats and all of them reported disarmed."""
    begun_s: float = 0.0

    def continued(self, radio: AutopilotLink) -> "GroundObservation":
        """Return it with all positions that have been received since it began."""
        positions = tuple(position for at_s, position in radio.seen.positions if at_s > self.begun_s)
        return replace(self, positions=positions)

    @property
    def altitude_m(self) -> float:
        """Altitude of the ground on the vehicle's own datum. Raises ValueError without a position."""
        return statistics.median(position.altitude_m for position in self.positions)

    @property
    def moved_m(self) -> float:
        """Range of its altitudes."""
        altitudes_m = [position.altitude_m for position in self.positions]
        return max(altitudes_m) - min(altitudes_m) if altitudes_m else 0.0

    @property
    def stands(self) -> bool:
        """Whether it was seen to stand, disarmed by every heartbeat."""
        return self.disarmed and bool(self.positions) and self.moved_m <= STANDS_WITHIN_M

    @property
    def is_at_reference(self) -> bool:
        """Whether its altitude is that of the ground reference."""
        return bool(self.positions) and abs(self.altitude_m) <= STANDS_WITHIN_M

    @property
    def last(self) -> Position:
        """Position with the latest time that continues another one: a single one by another clock is ignored, and so
        are copies that arrive late."""
        latest_first = sorted(self.positions, key=lambda position: position.time_boot_s, reverse=True)
        for newer, older in pairwise(latest_first):
            if newer.time_boot_s - older.time_boot_s < _GOES_ON_S:
                return newer
        return latest_first[0]


def observe(
    radio: AutopilotLink, secondary: AltitudeSource | None, *, watched_s: float = WATCHED_S
) -> GroundObservation:
    """Receive for `watched_s`, and for up to 10 s until there is a battery voltage and a heartbeat."""
    radio.listen(0.0)
    if secondary is not None:
        secondary.take()
    begun_s = radio.clock.now_s()
    armed: list[bool] = []
    while (now_s := radio.clock.now_s()) < begun_s + watched_s or (
        (radio.seen.battery_v is None or not armed) and now_s < begun_s + _BATTERY_S
    ):
        packets = radio.listen(LISTEN_S)
        armed += [each.measurement.armed for each in packets if isinstance(each.measurement, Heartbeat)]
    secondary_m = () if secondary is None else secondary.ground_altitudes()
    disarmed = bool(armed) and not any(armed)
    return GroundObservation((), now_s - begun_s, secondary_m, disarmed, begun_s).continued(radio)


def find_reception(positions: Sequence[tuple[float, Position]], now_s: float) -> tuple[float, float]:
    """Return how many positions arrived per second, without repeated ones, and the share that is lost, by the gaps
    between the others: in the last 10 s, or since there was none for a second. `positions` are given with the time of
    their receipt. In a single second a link that loses three of ten may seem to lose two. A gap must be one by both
    clocks, because a stamp may be false, and packets may arrive at once after a stall."""
    last_s = first_s = now_s
    heard: list[tuple[float, float]] = []
    for at_s, position in reversed(positions):
        last_s = last_s if heard else at_s
        if last_s - at_s > _RATE_OVER_S or first_s - at_s > _GOES_ON_S:
            break
        first_s = at_s
        heard.append((position.time_boot_s, at_s))
    new: dict[float, float] = {}
    for stamp_s, at_s in reversed(heard):
        new.setdefault(stamp_s, at_s)
    gaps = [(later[0] - earlier[0], later[1] - earlier[1]) for earlier, later in pairwise(new.items())]
    if not gaps:
        return 0.0, 0.0
    usual_s = statistics.median(later_s - earlier_s for earlier_s, later_s in pairwise(sorted(new)))
    lost = sum(max(int(min(gap) / usual_s + _IRREGULAR) - 1, 0) for gap in gaps)
    return len(gaps) / max(last_s - first_s, len(gaps) * usual_s), lost / (lost + len(gaps))


# ---- preparation


def confirm_stop(radio: AutopilotLink, watched: GroundObservation) -> None:
    """Find out whether a vehicle without a setting that stops its motors accepts the command that does. The command is
    sent only if the vehicle was just observed standing, disarmed by every heartbeat: in the air, it would fall."""
    is_needed = radio.profile.stop_settings and not radio.target.stop_settings
    if is_needed and not radio.link.duplicate_reason and watched.stands:
        reply = radio.request(
            commands.disarm(radio.target), lambda it: isinstance(it, CommandReply) and it.to == DISARMING
        )
        accepted = isinstance(reply, CommandReply) and reply.accepted
        radio.target = replace(radio.target, stops_by_command=accepted)


def require_disarmed(radio: AutopilotLink) -> None:
    """Wait until two heartbeats agree that the vehicle is disarmed. Raises SafeGainsError if it is armed, because only
    Land may be sent to it then, or if they do not agree within 5 s or are of two vehicles."""
    until_s = radio.clock.now_s() + HEARTBEAT_WITHIN_S * radio.timeout_factor
    while not radio.is_disarmed and radio.clock.now_s() < until_s:
        radio.listen(LISTEN_S)
    if radio.reports_armed:
        raise SafeGainsError(ARMED, hint=LAND_FIRST)
    if not radio.is_disarmed:
        raise SafeGainsError("Its heartbeats do not confirm that it is disarmed; nothing was written.", hint=LAND_FIRST)
    if why := radio.link.duplicate_reason:
        raise SafeGainsError(f"Two vehicles use its system id, so nothing was written. {why}", hint=ONE_VEHICLE)


def make_armable(radio: AutopilotLink) -> bool:
    """Switch a vehicle that is certainly disarmed out of a mode in which it does not arm; return whether it was."""
    heartbeat = radio.seen.heartbeat
    profile, may_arm = radio.profile, radio.seen.may_arm
    steps = () if heartbeat is None else profile.make_armable(radio.target, heartbeat.mode, may_arm=may_arm)
    until_s = radio.clock.now_s() + HEARTBEAT_WITHIN_S * radio.timeout_factor
    while steps and not radio.is_disarmed and not radio.reports_armed and radio.clock.now_s() < until_s:
        radio.listen(LISTEN_S)
    if not (steps and radio.is_disarmed):
        return False
    set_up(radio, steps)
    return True


def set_ground_reference(radio: AutopilotLink, watched: GroundObservation) -> bool:
    """Have the flight plan of a vehicle that was just observed standing, disarmed by every heartbeat, set its ground
    reference, unless it was heard to do so and the vehicle stands by it; wait for it for 13 s at most. Return whether
    to observe the vehicle again, because its altitudes may count from two zeros."""
    seen, steps, now_s = radio.seen, radio.profile.refer_to_ground(radio.target), radio.clock.now_s()
    if not steps or radio.link.duplicate_reason:
        return False
    if seen.has_ground_reference and watched.is_at_reference:
        return not watched.stands
    *passing, holding = radio.profile.ground_blocks
    if radio.block not in passing or now_s - seen.block_s > _REFERENCE_WITHIN_S:
        if not watched.stands:
            return True
        seen.has_ground_reference = False
        set_up(radio, steps)
    while not radio.is_armed and radio.clock.now_s() < now_s + _REFERENCE_WITHIN_S:
        radio.listen(LISTEN_S)
        if radio.block == holding and seen.block_s > now_s:
            return True
    return False
