"""Preparation of a vehicle on the ground: a mode in which it arms, its ground reference, a way to stop its
motors. What changes it is sent only once it is certainly disarmed.
"""

from dataclasses import replace
from typing import Final

from app.autopilots import commands
from app.autopilots.measurements import DISARMING, CommandReply
from app.vehicles.base import SafeGainsError
from app.vehicles.mavlink.command_sequence import set_up
from app.vehicles.mavlink.ground_observation import GroundObservation
from app.vehicles.mavlink.radio import AutopilotLink

ARMED: Final = "The vehicle is armed: either somebody else armed it, or a flight was interrupted."
LAND_FIRST: Final = "Land it, check that its motors have stopped, then verify its gains and release it."
ONE_VEHICLE: Final = "Switch the other vehicle off, or give each its own id."
_HEARTBEAT_S: Final = 5.0
_LISTEN_S: Final = 0.1
_REFERENCE_WITHIN_S: Final = 13.0
"""Time from a position on within which a flight plan sets its ground reference; 10 s in the stock plans."""


def confirm_stop(radio: AutopilotLink, watched: GroundObservation) -> None:
    """Find out whether a vehicle without a setting that stops its motors accepts the command that does. The command is
    sent only if the vehicle was just observed standing, disarmed by every heartbeat: in the air, it would fall."""
    if radio.target.stop_settings or not radio.profile.stop_settings or radio.link.duplicate_reason:
        return
    if watched.stands:
        reply = radio.request(
            commands.disarm(radio.target), lambda it: isinstance(it, CommandReply) and it.to == DISARMING
        )
        accepted = isinstance(reply, CommandReply) and reply.accepted
        radio.target = replace(radio.target, stops_by_command=accepted)


def require_disarmed(radio: AutopilotLink) -> None:
    """Wait until two heartbeats agree that the vehicle is disarmed. Raises SafeGainsError if it is armed, because only
    Land may be sent to it then, or if they do not agree within 5 s or are of two vehicles."""
    until_s = radio.clock.now_s() + _HEARTBEAT_S * radio.timeout_factor
    while not radio.is_disarmed and radio.clock.now_s() < until_s:
        radio.listen(_LISTEN_S)
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
    until_s = radio.clock.now_s() + _HEARTBEAT_S * radio.timeout_factor
    while steps and not radio.is_disarmed and not radio.reports_armed and radio.clock.now_s() < until_s:
        radio.listen(_LISTEN_S)
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
        radio.listen(_LISTEN_S)
        if radio.block == holding and seen.block_s > now_s:
            return True
    return False
