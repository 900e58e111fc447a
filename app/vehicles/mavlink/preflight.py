"""Preflight checks: identity of the vehicle, standing still on the ground, failsafes enabled.

Each check results in an item; the items shown to the operator are the ones that refuse a flight.
"""

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from app.core.control.px4_parameters import HOVER_THRUSTS
from app.core.experiments.step_sequence import LARGEST_PUSH_M_S2
from app.core.models.set_points import SetPoints
from app.vehicles.base import (
    ALTITUDE_LIMIT_M,
    HIGHEST_SET_POINT_M,
    LAND_COMMAND_S,
    CheckItem,
    Identity,
    SafeGainsError,
    VehicleError,
)
from app.vehicles.end_texts import FAILURE_TEXTS
from app.vehicles.mavlink.altitude_sources import AlignedAltitudeSource
from app.vehicles.mavlink.arming_checks import HEALTH_SUMMARY
from app.vehicles.mavlink.boot_clock import unwrapped
from app.vehicles.mavlink.events import DISARMING, CommandReply, Heartbeat, Position, VehicleEvent, Version
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.parameters import read_parameter
from app.vehicles.mavlink.profiles import PROFILES, base
from app.vehicles.mavlink.profiles.base import Requirement, Step
from app.vehicles.mavlink.radio import AutopilotLink

HEARTBEAT_S: Final = 5.0
WATCHED_S: Final = 2.0
POSITIONS_HZ: Final = 40.0
LOST_SHARE: Final = 0.2
"""Greatest share of the vehicle's positions that may be lost, whatever their rate."""
SECONDARY_HZ: Final = 10.0
ARMED: Final = "The vehicle is armed: either somebody else armed it, or a flight was interrupted."
_LISTEN_S: Final = 0.1
_AUTOPILOT: Final = 1
"""Usual component of an autopilot (MAV_COMP_ID_AUTOPILOT1): another one may pose as it."""
_STANDS_WITHIN_M: Final = 0.3
_REFERENCE_WITHIN_S: Final = 13.0
"""Time from a position on within which a flight plan sets its ground reference; 10 s in the stock plans."""
_RATE_OVER_S: Final = 10.0
_BATTERY_S: Final = 10.0
_GOES_ON_S: Final = 1.0
_IRREGULAR: Final = 0.25
"""Some autopilots send at intervals that differ by half: a position is lost from 1.75 intervals on."""
_DISARMED: Final = "disarmed"
_VERSION_ATTEMPTS: Final = 2
_UID_ATTEMPTS: Final = 10
"""Attempts if the vehicle is known to report its hardware id: twice as many as for a parameter."""
_NAME_ATTEMPTS: Final = 2
_CHECKS_ATTEMPTS: Final = 2
_NO_POSITION: Final = "Wait until it has a position (GPS, cameras or its own sensors), then check again."
_ONE_VEHICLE: Final = "Switch the other vehicle off, or give each its own id."
_LAND_FIRST: Final = "Land it, check that its motors have stopped, then verify its gains and release it."


@dataclass(frozen=True, slots=True)
class Ground:
    """Position of the standing vehicle on its own datum, and its altitudes from a second source, on the source's."""

    altitude_m: float
    last: Position
    secondary_m: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class GroundObservation:
    """Messages of a vehicle on the ground within `seconds`."""

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
    def ground(self) -> Ground:
        """Position of the ground. Raises ValueError without a position."""
        altitude_m = statistics.median(position.altitude_m for position in self.positions)
        return Ground(altitude_m, self._last, self.secondary_m)

    @property
    def stands(self) -> bool:
        """Whether it was seen to stand, disarmed by every heartbeat."""
        return self.disarmed and bool(self.positions) and _moved_m(self.positions) <= _STANDS_WITHIN_M

    @property
    def is_at_reference(self) -> bool:
        """Whether its altitude is that of the ground reference."""
        return bool(self.positions) and abs(self.ground.altitude_m) <= _STANDS_WITHIN_M

    @property
    def _last(self) -> Position:
        """Position with the latest time that continues another one: a single one by another clock is ignored, and so
        are copies that arrive late."""
        latest_first = sorted(self.positions, key=lambda position: position.time_boot_s, reverse=True)
        for newer, older in pairwise(latest_first):
            if newer.time_boot_s - older.time_boot_s < _GOES_ON_S:
                return newer
        return latest_first[0]


# ---- connecting to the vehicle


def await_vehicle(radio: AutopilotLink, address: str, pinned: Identity | None = None) -> None:
    """Wait for a heartbeat of the right autopilot, sending nothing. Raises VehicleError if none arrives within 5 s
    (longer if the vehicle's clock is fast), or if it is of another vehicle than the `pinned` one."""
    within_s = HEARTBEAT_S * radio.timeout_factor
    until_s = radio.clock.now_s() + within_s
    other: Heartbeat | None = None
    while radio.clock.now_s() < until_s:
        heard = [each.measurement for each in radio.listen(_LISTEN_S) if isinstance(each.measurement, Heartbeat)]
        for heartbeat in (each for each in heard if each.autopilot == radio.profile.autopilot):
            if heartbeat.component == _AUTOPILOT:
                return _set_target(radio, heartbeat, pinned)
            if other is None:
                until_s = radio.clock.now_s() + radio.silence_s
                other = heartbeat
    if other is not None:
        return _set_target(radio, other, pinned)
    if makes := radio.link.other_makes:
        raise VehicleError(
            f"{_named(makes)} {'answers' if len(makes) == 1 else 'answer'} at {address}, not {radio.profile.title}; "
            "nothing was sent.",
            hint="If this is the vehicle, register it again as what it is: a vehicle's autopilot cannot be changed. "
            "Otherwise check that no other vehicle sends to this address.",
        )
    raise VehicleError(
        f"{FAILURE_TEXTS[Failure.NO_HEARTBEAT]} Waited {within_s:g} s at {address} for {radio.profile.title}.",
        hint="Check that the vehicle is on, that it sends to this computer's port, and that the right autopilot is "
        "selected.",
    )


def _named(makes: Iterable[int]) -> str:
    """The autopilots with these MAV_AUTOPILOT."""
    titles = {profile.autopilot: profile.title for profile in PROFILES.values()}
    names = " and ".join(titles.get(make, f"another autopilot ({make})") for make in sorted(makes))
    return names[:1].upper() + names[1:]


def _set_target(radio: AutopilotLink, heartbeat: Heartbeat, pinned: Identity | None) -> None:
    if pinned is not None and pinned.system_id != heartbeat.system:
        raise VehicleError(
            f"Another vehicle answers: system {heartbeat.system} instead of {pinned.system_id}.",
            hint="Connect the registered vehicle, or register this one.",
        )
    radio.target = replace(
        radio.target,
        system=heartbeat.system,
        component=heartbeat.component,
        aircraft=radio.target.aircraft or heartbeat.system,
    )


def read_vehicle_info(radio: AutopilotLink) -> str:
    """Read the flight plan and the firmware's version, changing nothing; return the plan's problem, or an empty
    string."""
    problem = ""
    try:
        radio.target = replace(radio.target, blocks=radio.profile.explore(radio.request, radio.target))
    except VehicleError as error:
        problem = str(error)
    radio.send(*radio.profile.conclude(radio.target))
    identify(radio)
    has = tuple(name for name in radio.profile.stop_settings if _has(radio, name))
    newer = {
        requirement.parameter: requirement.newer_name
        for requirement in radio.profile.requirements
        if requirement.newer_name and not _has(radio, requirement.parameter) and _has(radio, requirement.newer_name)
    }
    radio.target = replace(radio.target, stop_settings=has, newer_names=newer)
    return problem


def identify(radio: AutopilotLink, pinned: Identity | None = None) -> None:
    """Request version and hardware id, if neither has been received since the vehicle was last absent. Some never
    reply, and Paparazzi sends them unrequested; if the pinned vehicle has a hardware id, it is requested for 5 s."""
    radio.receive_pending()
    request, is_needed = radio.profile.version_request(radio.target), bool(find_missing_uid(radio, pinned))
    if request is not None and (is_needed or not (radio.seen.version or radio.seen.uid)):
        attempts = _UID_ATTEMPTS if is_needed else _VERSION_ATTEMPTS
        radio.request(request, lambda reply: isinstance(reply, Version), attempts=attempts)


def _has(radio: AutopilotLink, parameter: str) -> bool:
    return read_parameter(radio, parameter, attempts=_NAME_ATTEMPTS) is not None


def confirm_stop(radio: AutopilotLink, watched: GroundObservation) -> None:
    """Find out whether a vehicle without a setting that stops its motors accepts the command that does. The command is
    sent only if the vehicle was just observed standing, disarmed by every heartbeat: in the air, it would fall."""
    if radio.target.stop_settings or not radio.profile.stop_settings or radio.link.duplicate_reason:
        return
    if watched.stands:
        reply = radio.request(base.disarm(radio.target), lambda it: isinstance(it, CommandReply) and it.to == DISARMING)
        accepted = isinstance(reply, CommandReply) and reply.accepted
        radio.target = replace(radio.target, stops_by_command=accepted)


def identity_change(radio: AutopilotLink, pinned: Identity | None) -> str:
    """Return how the vehicle differs from the pinned one, in what both report; empty if it does not."""
    version, uid = radio.seen.version, radio.seen.uid
    if pinned is None:
        return ""
    if is_another(radio, pinned):
        return (
            f"Another vehicle answers, and nothing is written to it: its hardware id is {uid} instead of {pinned.uid}. "
            f"Register it as a new vehicle, or release it to accept it in place of this one."
        )
    if not version or not pinned.version or version == pinned.version:
        return ""
    return f"Its firmware has changed from version {pinned.version} to {version}."


def is_another(radio: AutopilotLink, pinned: Identity | None) -> bool:
    """Whether its hardware id differs from the pinned one, if both are known."""
    uid = radio.seen.uid
    return pinned is not None and bool(uid and pinned.uid) and uid != pinned.uid


def find_missing_uid(radio: AutopilotLink, pinned: Identity | None) -> str:
    """Return the problem that a vehicle with a pinned hardware id has reported none since it was last absent; empty if
    it has."""
    if pinned is None or not pinned.uid or radio.seen.uid:
        return ""
    return "It did not report its hardware id, so it may be another vehicle; nothing was written."


def reports_armed(radio: AutopilotLink) -> bool:
    """Whether its last heartbeat reports that it is armed; `radio.is_armed` takes two."""
    return radio.seen.heartbeat is not None and radio.seen.heartbeat.armed


def require_disarmed(radio: AutopilotLink) -> None:
    """Wait until two heartbeats agree that the vehicle is disarmed. Raises SafeGainsError if it is armed, because only
    Land may be sent to it then, or if they do not agree within 5 s or are of two vehicles."""
    until_s = radio.clock.now_s() + HEARTBEAT_S * radio.timeout_factor
    while not radio.is_disarmed and radio.clock.now_s() < until_s:
        radio.listen(_LISTEN_S)
    if reports_armed(radio):
        raise SafeGainsError(ARMED, hint=_LAND_FIRST)
    if not radio.is_disarmed:
        raise SafeGainsError(
            "Its heartbeats do not confirm that it is disarmed; nothing was written.", hint=_LAND_FIRST
        )
    if why := radio.link.duplicate_reason:
        raise SafeGainsError(f"Two vehicles use its system id, so nothing was written. {why}", hint=_ONE_VEHICLE)


def prepare(radio: AutopilotLink, telemetry_hz: float) -> None:
    """Request telemetry. Raises VehicleError if it is refused."""
    _set_up(radio, radio.profile.prepare(radio.target, telemetry_hz))


def prepare_set_points(radio: AutopilotLink) -> None:
    """Request the further telemetry of a flight with several set points. Raises VehicleError if it is refused."""
    _set_up(radio, radio.profile.prepare_set_points(radio.target))


def make_armable(radio: AutopilotLink) -> bool:
    """Switch a vehicle that is certainly disarmed out of a mode in which it does not arm; return whether it was."""
    heartbeat = radio.seen.heartbeat
    profile, may_arm = radio.profile, radio.seen.may_arm
    steps = () if heartbeat is None else profile.make_armable(radio.target, heartbeat.mode, may_arm=may_arm)
    until_s = radio.clock.now_s() + HEARTBEAT_S * radio.timeout_factor
    while steps and not radio.is_disarmed and not reports_armed(radio) and radio.clock.now_s() < until_s:
        radio.listen(_LISTEN_S)
    if not (steps and radio.is_disarmed):
        return False
    _set_up(radio, steps)
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
        _set_up(radio, steps)
    while not radio.is_armed and radio.clock.now_s() < now_s + _REFERENCE_WITHIN_S:
        radio.listen(_LISTEN_S)
        if radio.block == holding and seen.block_s > now_s:
            return True
    return False


def _set_up(radio: AutopilotLink, steps: tuple[Step, ...]) -> None:
    if why := radio.set_up(steps):
        raise VehicleError(f"The vehicle could not be set up. {why}", hint="Correct what it reports, then try again.")


# ---- checks


def observe(
    radio: AutopilotLink, secondary: AlignedAltitudeSource | None, *, watched_s: float = WATCHED_S
) -> GroundObservation:
    """Receive for `watched_s`, and for up to 10 s until there is a battery voltage and a heartbeat."""
    radio.listen(0.0)
    if secondary is not None:
        secondary.discard_pending()
    begun_s = radio.clock.now_s()
    armed: list[bool] = []
    while (now_s := radio.clock.now_s()) < begun_s + watched_s or (
        (radio.seen.battery_v is None or not armed) and now_s < begun_s + _BATTERY_S
    ):
        packets = radio.listen(_LISTEN_S)
        armed += [each.measurement.armed for each in packets if isinstance(each.measurement, Heartbeat)]
    secondary_m = () if secondary is None else secondary.ground_altitudes()
    disarmed = bool(armed) and not any(armed)
    return GroundObservation((), now_s - begun_s, secondary_m, disarmed, begun_s).continued(radio)


def evaluate_items(
    radio: AutopilotLink, watched: GroundObservation, *, min_battery_v: float, plan_problem: str
) -> tuple[CheckItem, ...]:
    """Evaluate all checks except those of the gains and the second source; requests the parameters of the failsafes."""
    items = [
        _heartbeat(radio),
        _single_vehicle_item(radio),
        _disarmed(radio),
        *_motion(watched, find_reception(radio.seen.positions, radio.clock.now_s())),
        _battery(radio.seen.battery_v, min_battery_v),
    ]
    if radio.profile.flying_blocks:
        items += [_flight_plan(plan_problem), _ground_reference(radio, watched)]
    if radio.profile.stop_settings:
        items.append(_stopping(radio))
    return (*items, *_own_checks(radio), *(_failsafe(radio, requirement) for requirement in radio.profile.requirements))


def evaluate_secondary(secondary: AlignedAltitudeSource, watched: GroundObservation) -> CheckItem:
    rate_hz = len(watched.secondary_m) / watched.seconds
    return CheckItem(
        name="second_source",
        title="Second source of altitude",
        passed=rate_hz >= SECONDARY_HZ,
        found=secondary.source.trouble.removesuffix(".")
        or f"{rate_hz:.0f} samples per second of {secondary.source.name}",
        needed=f"{SECONDARY_HZ:g} per second or more",
        hint="Check that it tracks the vehicle and streams, or fly without it.",
    )


def evaluate_uid(radio: AutopilotLink, pinned: Identity) -> CheckItem:
    """Compare the hardware id with the pinned one."""
    passed = radio.seen.uid == pinned.uid
    return CheckItem(
        name="hardware_id",
        title="Hardware id",
        passed=passed,
        found=radio.seen.uid or "not reported",
        needed=f"{pinned.uid}, as registered",
        hint=""
        if passed
        else "Check which vehicle it is, then try again. If it no longer reports one, connect it again and release it.",
    )


def evaluate_distance(watched: GroundObservation, *, radius_m: float, plan_radius_m: float) -> CheckItem:
    """Check the distance from HOME, the zero of its position: beyond `plan_radius_m` the flight plan lands the vehicle
    by itself, and beyond a larger distance it flies HOME and ignores all commands."""
    last = watched.positions[-1] if watched.positions else None
    away_m = None if last is None else max(abs(last.north_m), abs(last.east_m))
    passed = away_m is not None and away_m + radius_m <= plan_radius_m
    return CheckItem(
        name="home",
        title="Distance from HOME",
        passed=passed,
        found="waiting for a position"
        if away_m is None
        else f"{away_m:.1f} m, plus the {radius_m:g} m that it may move from its start",
        needed=f"{plan_radius_m:g} m or less in total: beyond it the flight plan lands it",
        hint=""
        if passed
        else "Move it closer to the place where it was switched on, or reduce its “Maximum distance from the start”.",
    )


def evaluate_flight_time(record_s: float, *, plan_time_s: float) -> CheckItem:
    """Check that the flight plan does not land the vehicle before its record of `record_s` is complete."""
    needed_s = record_s + LAND_COMMAND_S
    passed = needed_s <= plan_time_s
    return CheckItem(
        name="flight time",
        title="Flight time",
        passed=passed,
        found=f"{needed_s:g} s for the record and the command to land",
        needed=f"{plan_time_s:g} s or less: after it the flight plan lands it",
        hint=""
        if passed
        else "Choose a shorter window; or raise the time limit of Takeoff in its flight plan, then the vehicle's "
        f"setting “Paparazzi: time limit of the flight plan's takeoff” (plan_time_s), to {needed_s:g} s or more.",
    )


def evaluate_set_point_requirements(radio: AutopilotLink) -> tuple[CheckItem, ...]:
    """Read and check the further requirements of a flight with several set points."""
    return tuple(_failsafe(radio, requirement) for requirement in radio.profile.set_point_requirements)


def evaluate_set_points(set_points: SetPoints) -> CheckItem:
    """Check that the set points are well below the altitude limit and well above the ground."""
    first_m, lowest_m, highest_m = set_points.altitudes_m[0], min(set_points.altitudes_m), max(set_points.altitudes_m)
    pushed_m_s2 = max(map(abs, set_points.accelerations_m_s2), default=0.0)
    passed = highest_m <= HIGHEST_SET_POINT_M and lowest_m > 0.5 * first_m and pushed_m_s2 <= LARGEST_PUSH_M_S2
    pushed = f", pushed by {pushed_m_s2:g} m/s²" if pushed_m_s2 else ""
    return CheckItem(
        name="altitudes",
        title="Altitudes",
        passed=passed,
        found=f"set points from {lowest_m:g} to {highest_m:g} m{pushed}",
        needed=f"above {0.5 * first_m:g} m, half of the first, and at most {HIGHEST_SET_POINT_M:g} m: the flight is "
        f"aborted at {ALTITUDE_LIMIT_M:g} m" + (f"; at most {LARGEST_PUSH_M_S2:g} m/s²" if pushed else ""),
        hint="" if passed else "Choose a lower height, or smaller steps.",
    )


def evaluate_hover(hover_throttle: float | None, limits: tuple[float, float] | None) -> tuple[CheckItem, ...]:
    """Check that the autopilot's estimate can reach the throttle at which the vehicle hovered in its last flight; no
    item while one of the two is not known."""
    if hover_throttle is None or limits is None:
        return ()
    low, high = limits
    passed = low <= hover_throttle <= high
    item = CheckItem(
        name="hover_throttle",
        title="Hover throttle",
        passed=passed,
        found=f"{hover_throttle:.2f} in the last flight",
        needed=f"within MPC_THR_HOVER ± HTE_THR_RANGE, {low:.2f} … {high:.2f}: PX4's estimate stops there",
        hint=""
        if passed
        else f"Set MPC_THR_HOVER to {min(hover_throttle, HOVER_THRUSTS[1]):.2f}. If the vehicle or its "
        "load was changed since that flight, disconnect it and connect it again instead.",
    )
    return (item,)


def require(items: Sequence[CheckItem]) -> None:
    """Raise VehicleError naming every failed check, or SafeGainsError if the vehicle is armed."""
    failed = [item for item in items if not item.passed]
    if any(item.name == _DISARMED for item in failed):
        raise SafeGainsError(ARMED, hint=_LAND_FIRST)
    if failed:
        found = "; ".join(f"{item.title}: {item.found}, required: {item.needed}" for item in failed)
        hints = " ".join(dict.fromkeys(item.hint for item in failed if item.hint))
        raise VehicleError(f"The vehicle is not ready to fly. {found}.", hint=hints or "Correct this, then try again.")


def _heartbeat(radio: AutopilotLink) -> CheckItem:
    age_s = radio.clock.now_s() - radio.seen.heartbeat_s
    heartbeat = radio.seen.heartbeat
    make = heartbeat is not None and heartbeat.autopilot == radio.profile.autopilot
    version = f" {radio.seen.version}" if radio.seen.version else ""
    oldest_s = radio.silence_s
    return CheckItem(
        name="heartbeat",
        title="Heartbeat",
        passed=make and age_s < oldest_s,
        found=f"{radio.profile.title}{version}, system {radio.target.system}, {age_s:.1f} s ago"
        if make
        else "another autopilot",
        needed=f"{radio.profile.title}, within {oldest_s:g} s",
        hint="Check that it is on and in range.",
    )


def _single_vehicle_item(radio: AutopilotLink) -> CheckItem:
    duplicate_reason = radio.link.duplicate_reason
    return CheckItem(
        name="alone",
        title="System id",
        passed=not duplicate_reason,
        found=duplicate_reason.removesuffix(".") or f"one vehicle uses system id {radio.target.system}",
        needed="one vehicle per system id on this link",
        hint=_ONE_VEHICLE if duplicate_reason else "",
    )


def _stopping(radio: AutopilotLink) -> CheckItem:
    ways = [f"the setting {name}" for name in radio.target.stop_settings]
    ways += ["the command to disarm"] if radio.target.stops_by_command else []
    return CheckItem(
        name="motors_off",
        title="Motors off",
        passed=bool(ways),
        found=" and ".join(ways) or "the vehicle did not confirm any command that stops its motors",
        needed="a confirmed way to stop its motors",
        hint="" if ways else "Build it with settings/rotorcraft_basic.xml (docs/real-flight.md), then connect again.",
    )


def _own_checks(radio: AutopilotLink) -> tuple[CheckItem, ...]:
    """Return the item of its arming checks; none if it reports nothing of them, by events neither."""
    if not radio.seen.may_arm and not reports_armed(radio):
        _request_checks(radio)
    ready = radio.seen.may_arm
    if ready is None:
        return ()
    item = CheckItem(
        name="own_checks",
        title="Arming checks of the autopilot",
        passed=ready,
        found="passed" if ready else f"not passed; {_reasons(radio)}",
        needed="passed",
        hint="" if ready else _checks_hint(radio),
    )
    return (item,)


def _request_checks(radio: AutopilotLink) -> None:
    """Request the results of the arming checks as events, if the vehicle supports them; earlier events were missed."""
    request = radio.profile.checks_request(radio.target)
    if request is not None:
        radio.request(
            request,
            lambda reply: isinstance(reply, VehicleEvent) and reply.number == HEALTH_SUMMARY,
            attempts=_CHECKS_ATTEMPTS,
        )


def _reasons(radio: AutopilotLink) -> str:
    """Return the failing components and the last status texts."""
    failing = radio.seen.arming_checks.failing(_mode(radio))
    texts = " / ".join(radio.seen.status_texts)
    components = f"failing: {', '.join(failing)}" if failing else ""
    messages = f"messages: {texts or 'none'}" if texts or not failing else ""
    return "; ".join(part for part in (components, messages) if part)


def _checks_hint(radio: AutopilotLink) -> str:
    profile, arming_modes = radio.profile, radio.seen.arming_checks.arming_modes
    hints = ["Correct what it reports; after power-on, wait until it has settled."]
    if _mode(radio) not in arming_modes and (others := sorted(profile.flying_modes & arming_modes)):
        hints.append(f"It can be armed in mode {' or '.join(profile.mode_names[mode] for mode in others)}.")
    if profile.checks_request(radio.target) is not None:
        hints.append("QGroundControl shows the reasons in full.")
    return " ".join(hints)


def _mode(radio: AutopilotLink) -> str:
    return "" if radio.seen.heartbeat is None else radio.seen.heartbeat.mode


def _disarmed(radio: AutopilotLink) -> CheckItem:
    armed = reports_armed(radio)
    return CheckItem(
        name=_DISARMED,
        title="Motors",
        passed=not armed,
        found="armed" if armed else "disarmed",
        needed="disarmed",
        hint=_LAND_FIRST if armed else "",
    )


def _motion(watched: GroundObservation, reception: tuple[float, float]) -> tuple[CheckItem, ...]:
    positions, (rate_hz, lost_share) = watched.positions, reception
    passed_s = unwrapped(positions[-1], positions[0]).time_boot_s - positions[0].time_boot_s if positions else 0.0
    moved_m = _moved_m(positions)
    return (
        CheckItem(
            name="position",
            title="Position",
            passed=rate_hz >= POSITIONS_HZ and lost_share <= LOST_SHARE,
            found=f"{rate_hz:.1f} per second, {100.0 * lost_share:.0f} % lost",
            needed=f"{POSITIONS_HZ:g} per second or more, {100.0 * LOST_SHARE:.0f} % lost or less",
            hint="Configure its telemetry for tuning (docs/real-flight.md), or improve a weak link and wait for 10 s."
            if positions
            else _NO_POSITION,
        ),
        CheckItem(
            name="clock",
            title="Vehicle clock",
            passed=passed_s > 0.0,
            found=f"{passed_s:.2f} s passed in {watched.seconds:.2f} s" if positions else "waiting for a position",
            needed="an advancing clock",
            hint="Restart the vehicle." if positions else _NO_POSITION,
        ),
        CheckItem(
            name="still",
            title="Standing still",
            passed=bool(positions) and moved_m <= _STANDS_WITHIN_M,
            found=f"its altitude changed by {moved_m:.2f} m" if positions else "waiting for a position",
            needed=f"{_STANDS_WITHIN_M:g} m or less",
            hint="Put it on firm ground and let its position settle." if positions else _NO_POSITION,
        ),
    )


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


def _moved_m(positions: Sequence[Position]) -> float:
    altitudes = [position.altitude_m for position in positions]
    return max(altitudes) - min(altitudes) if altitudes else 0.0


def _battery(battery_v: float | None, min_battery_v: float) -> CheckItem:
    return CheckItem(
        name="battery",
        title="Battery",
        passed=battery_v is not None and battery_v >= min_battery_v,
        found="no voltage reported" if battery_v is None else f"{battery_v:.1f} V",
        needed=f"{min_battery_v:g} V or more",
        hint="Insert a charged battery, or correct the limit.",
    )


def _flight_plan(problem: str) -> CheckItem:
    return CheckItem(
        name="flight_plan",
        title="Flight plan",
        passed=not problem,
        found=problem or "blocks for takeoff and landing",
        needed="blocks for takeoff and landing",
        hint="Load a flight plan with these blocks (docs/real-flight.md), then connect again." if problem else "",
    )


def _ground_reference(radio: AutopilotLink, watched: GroundObservation) -> CheckItem:
    """Check that the flight plan was heard to set the ground reference, if it can, and that the vehicle stands by it:
    a takeoff's altitude counts from there, and so does its error."""
    is_set = radio.seen.has_ground_reference or not radio.profile.refer_to_ground(radio.target)
    passed = is_set and watched.is_at_reference
    at = f"it stands at {watched.ground.altitude_m:.2f} m" if watched.positions else "waiting for a position"
    mode = radio.profile.mode_names.get(_mode(radio), _mode(radio))
    return CheckItem(
        name="ground_reference",
        title="Ground reference",
        passed=passed,
        found=at if is_set else f"not set by the flight plan (mode {mode}, block {radio.block or 'not reported'})",
        needed=f"set by the flight plan, within {_STANDS_WITHIN_M:g} m of where it stands",
        hint=""
        if passed
        else "Leave it on the ground where it starts, in its automatic mode, until it has a position, then check "
        "again: its flight plan sets the reference, which takes 10 s.",
    )


def _failsafe(radio: AutopilotLink, requirement: Requirement) -> CheckItem:
    parameter = radio.target.newer_names.get(requirement.parameter, requirement.parameter)
    value = read_parameter(radio, parameter)
    off = " (off)" if value == 0.0 and not requirement.values else ""
    return CheckItem(
        name=f"failsafe {requirement.parameter}",
        title=f"{'Setting' if requirement.clear_bits else 'Failsafe'} {parameter}",
        passed=requirement.may_lack if value is None else requirement.is_met(value),
        found="not reported" if value is None else f"{value:g}{off}",
        needed=requirement.what,
        hint=f"{_correction(requirement, parameter, value)} in the autopilot; Gainline does not change it.",
    )


def _correction(requirement: Requirement, parameter: str, value: float | None) -> str:
    """How to correct a parameter that holds this value: what to subtract or add where only some of its bits count."""
    held = 0 if value is None else int(value)
    if surplus := held & requirement.clear_bits:
        return f"Subtract {surplus} from {parameter}"
    if held > 0 and (missing := requirement.bits & ~held):
        return f"Add {missing} to {parameter}"
    return f"Set {parameter}"
