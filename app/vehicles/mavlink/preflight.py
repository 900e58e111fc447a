"""Preflight checks: one vehicle, standing still on the ground, received well, with its failsafes enabled.

Each check results in an item; the items shown to the operator are the ones that refuse a flight.
"""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from app.autopilots import commands
from app.autopilots.autopilot import HoverLimits, Requirement
from app.autopilots.measurements import VehicleEvent
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
from app.vehicles.mavlink.altitude_sources import AltitudeSource
from app.vehicles.mavlink.monitors.clock import unwrapped
from app.vehicles.mavlink.parameters import read_parameter
from app.vehicles.mavlink.preparation import (
    ARMED,
    LAND_FIRST,
    ONE_VEHICLE,
    STANDS_WITHIN_M,
    GroundObservation,
    find_reception,
)
from app.vehicles.mavlink.radio import AutopilotLink

POSITIONS_HZ: Final = 40.0
LOST_SHARE: Final = 0.2
"""Greatest share of the vehicle's positions that may be lost, whatever their rate."""
SECONDARY_HZ: Final = 10.0
_TEXTS: Final = tomllib.loads((Path(__file__).parent / "checks.toml").read_text("utf-8"))
_DISARMED: Final = "disarmed"
_NO_POSITION: Final = "Wait until it has a position (GPS, cameras or its own sensors), then check again."


def evaluate_items(
    radio: AutopilotLink, watched: GroundObservation, *, min_battery_v: float, plan_problem: str
) -> tuple[CheckItem, ...]:
    """Evaluate all checks except those of the gains and the second source; requests the parameters of the failsafes."""
    items = [
        _heartbeat(radio),
        _single_vehicle(radio),
        _item(
            _DISARMED, not radio.reports_armed, "armed" if radio.reports_armed else "disarmed", "disarmed", LAND_FIRST
        ),
        *_motion(watched, find_reception(radio.seen.positions, radio.clock.now_s())),
        _battery(radio.seen.battery_v, min_battery_v),
    ]
    if radio.profile.flying_blocks:
        blocks = "blocks for takeoff and landing"
        plan = _item("flight_plan", not plan_problem, plan_problem or blocks, blocks)
        items += [plan, _ground_reference(radio, watched)]
    if radio.profile.stop_settings:
        items.append(_stopping(radio))
    return (
        *items,
        *_own_checks(radio),
        *(evaluate_requirement(radio, requirement) for requirement in radio.profile.requirements),
    )


def evaluate_secondary(secondary: AltitudeSource, watched: GroundObservation) -> CheckItem:
    rate_hz = len(watched.secondary_m) / watched.seconds
    rate = f"{rate_hz:.0f} samples per second of {secondary.name}"
    found = secondary.trouble.removesuffix(".") or rate
    return _item("second_source", rate_hz >= SECONDARY_HZ, found, f"{SECONDARY_HZ:g} per second or more")


def evaluate_uid(radio: AutopilotLink, pinned: Identity) -> CheckItem:
    """Compare the hardware id with the pinned one."""
    uid = radio.seen.uid
    return _item("hardware_id", uid == pinned.uid, uid or "not reported", f"{pinned.uid}, as registered")


def evaluate_distance(watched: GroundObservation, *, radius_m: float, plan_radius_m: float) -> CheckItem:
    """Check the distance from HOME, the zero of its position: beyond `plan_radius_m` the flight plan lands the vehicle
    by itself, and beyond a larger distance it flies HOME and ignores all commands."""
    passed, found = False, "waiting for a position"
    if watched.positions:
        away_m = max(abs(watched.positions[-1].north_m), abs(watched.positions[-1].east_m))
        passed = away_m + radius_m <= plan_radius_m
        found = f"{away_m:.1f} m, plus the {radius_m:g} m that it may move from its start"
    return _item("home", passed, found, f"{plan_radius_m:g} m or less in total: beyond it the flight plan lands it")


def evaluate_flight_time(record_s: float, *, plan_time_s: float) -> CheckItem:
    """Check that the flight plan does not land the vehicle before its record of `record_s` is complete."""
    needed_s = record_s + LAND_COMMAND_S
    return _item(
        "flight time",
        needed_s <= plan_time_s,
        f"{needed_s:g} s for the record and the command to land",
        f"{plan_time_s:g} s or less: after it the flight plan lands it",
        needed_s=needed_s,
    )


def evaluate_set_points(set_points: SetPoints) -> CheckItem:
    """Check that the set points are well below the altitude limit and well above the ground."""
    first_m, lowest_m, highest_m = set_points.altitudes_m[0], min(set_points.altitudes_m), max(set_points.altitudes_m)
    pushed_m_s2 = max(map(abs, set_points.accelerations_m_s2), default=0.0)
    return _item(
        "altitudes",
        highest_m <= HIGHEST_SET_POINT_M and lowest_m > 0.5 * first_m and pushed_m_s2 <= LARGEST_PUSH_M_S2,
        f"set points from {lowest_m:g} to {highest_m:g} m"
        + (f", pushed by {pushed_m_s2:g} m/s²" if pushed_m_s2 else ""),
        f"above {0.5 * first_m:g} m, half of the first, and at most {HIGHEST_SET_POINT_M:g} m: the flight is "
        f"aborted at {ALTITUDE_LIMIT_M:g} m" + (f"; at most {LARGEST_PUSH_M_S2:g} m/s²" if pushed_m_s2 else ""),
    )


def evaluate_hover(hover_throttle: float | None, limits: HoverLimits | None) -> tuple[CheckItem, ...]:
    """Check that the autopilot's estimate can reach the throttle at which the vehicle hovered in its last flight; no
    item while one of the two is not known."""
    if hover_throttle is None or limits is None:
        return ()
    return (
        _item(
            "hover_throttle",
            limits.low <= hover_throttle <= limits.high,
            f"{hover_throttle:.2f} in the last flight",
            limits.words,
            parameter=limits.parameter,
            most=min(hover_throttle, limits.most),
        ),
    )


def require(items: Sequence[CheckItem]) -> None:
    """Raise VehicleError naming every failed check, or SafeGainsError if the vehicle is armed."""
    failed = [item for item in items if not item.passed]
    if any(item.name == _DISARMED for item in failed):
        raise SafeGainsError(ARMED, hint=LAND_FIRST)
    if failed:
        found = "; ".join(f"{item.title}: {item.found}, required: {item.needed}" for item in failed)
        hints = " ".join(dict.fromkeys(item.hint for item in failed if item.hint))
        raise VehicleError(f"The vehicle is not ready to fly. {found}.", hint=hints or "Correct this, then try again.")


def _item(name: str, passed: bool, found: str, needed: str, hint: str = "", **values: str | float) -> CheckItem:
    """The result of a check; if it failed, with what to do: the `hint`, or else that of this check with the values."""
    text = _TEXTS[name]
    advice = "" if passed else hint or text["hint"].format(**values)
    return CheckItem(name=name, title=text["title"], passed=passed, found=found, needed=needed, hint=advice)


def _heartbeat(radio: AutopilotLink) -> CheckItem:
    age_s, heartbeat, title = radio.clock.now_s() - radio.seen.heartbeat_s, radio.seen.heartbeat, radio.profile.title
    version = f" {radio.seen.version}" if radio.seen.version else ""
    make = heartbeat is not None and heartbeat.autopilot == radio.profile.autopilot
    found = f"{title}{version}, system {radio.target.system}, {age_s:.1f} s ago" if make else "another autopilot"
    return _item("heartbeat", make and age_s < radio.silence_s, found, f"{title}, within {radio.silence_s:g} s")


def _single_vehicle(radio: AutopilotLink) -> CheckItem:
    reason = radio.link.duplicate_reason
    found = reason.removesuffix(".") or f"one vehicle uses system id {radio.target.system}"
    return _item("alone", not reason, found, "one vehicle per system id on this link", ONE_VEHICLE)


def _stopping(radio: AutopilotLink) -> CheckItem:
    ways = [f"the setting {name}" for name in radio.target.stop_settings]
    ways += ["the command to disarm"] if radio.target.stops_by_command else []
    found = " and ".join(ways) or "the vehicle did not confirm any command that stops its motors"
    return _item("motors_off", bool(ways), found, "a confirmed way to stop its motors")


def _own_checks(radio: AutopilotLink) -> tuple[CheckItem, ...]:
    """Return the item of its arming checks, requested as events if it supports them; none if it reports nothing of
    them, by events neither."""
    checks = radio.profile.checks
    if checks is not None and not radio.seen.may_arm and not radio.reports_armed:  # earlier events were missed
        radio.request(
            commands.command(radio.target, checks.command),
            lambda reply: isinstance(reply, VehicleEvent) and reply.number == checks.last,
            attempts=2,
        )
    ready = radio.seen.may_arm
    if ready is None:
        return ()
    found = "passed" if ready else f"not passed; {_reasons(radio)}"
    return (_item("own_checks", ready, found, "passed", _checks_hint(radio)),)


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
    if profile.checks is not None:
        hints.append("QGroundControl shows the reasons in full.")
    return " ".join(hints)


def _mode(radio: AutopilotLink) -> str:
    return "" if radio.seen.heartbeat is None else radio.seen.heartbeat.mode


def _motion(watched: GroundObservation, reception: tuple[float, float]) -> tuple[CheckItem, ...]:
    positions, moved_m, (rate_hz, lost_share) = watched.positions, watched.moved_m, reception
    passed_s = unwrapped(positions[-1], positions[0]).time_boot_s - positions[0].time_boot_s if positions else 0.0
    hint, waiting = ("", "") if positions else (_NO_POSITION, "waiting for a position")
    return (
        _item(
            "position",
            rate_hz >= POSITIONS_HZ and lost_share <= LOST_SHARE,
            f"{rate_hz:.1f} per second, {100.0 * lost_share:.0f} % lost",
            f"{POSITIONS_HZ:g} per second or more, {100.0 * LOST_SHARE:.0f} % lost or less",
            hint,
        ),
        _item(
            "clock",
            passed_s > 0.0,
            waiting or f"{passed_s:.2f} s passed in {watched.seconds:.2f} s",
            "an advancing clock",
            hint,
        ),
        _item(
            "still",
            bool(positions) and moved_m <= STANDS_WITHIN_M,
            waiting or f"its altitude changed by {moved_m:.2f} m",
            f"{STANDS_WITHIN_M:g} m or less",
            hint,
        ),
    )


def _battery(battery_v: float | None, min_battery_v: float) -> CheckItem:
    found = "no voltage reported" if battery_v is None else f"{battery_v:.1f} V"
    return _item(
        "battery",
        battery_v is not None and battery_v >= min_battery_v,
        found,
        f"{min_battery_v:g} V or more",
    )


def _ground_reference(radio: AutopilotLink, watched: GroundObservation) -> CheckItem:
    """Check that the flight plan was heard to set the ground reference, if it can, and that the vehicle stands by it:
    a takeoff's altitude counts from there, and so does its error."""
    is_set = radio.seen.has_ground_reference or not radio.profile.refer_to_ground(radio.target)
    found = f"it stands at {watched.altitude_m:.2f} m" if watched.positions else "waiting for a position"
    if not is_set:
        mode = radio.profile.mode_names.get(_mode(radio), _mode(radio))
        found = f"not set by the flight plan (mode {mode}, block {radio.block or 'not reported'})"
    return _item(
        "ground_reference",
        is_set and watched.is_at_reference,
        found,
        f"set by the flight plan, within {STANDS_WITHIN_M:g} m of where it stands",
    )


def evaluate_requirement(radio: AutopilotLink, requirement: Requirement) -> CheckItem:
    """Read the parameter of a requirement and check it."""
    parameter = radio.target.newer_names.get(requirement.parameter, requirement.parameter)
    value = read_parameter(radio, parameter)
    off = " (off)" if value == 0.0 and not requirement.values else ""
    kind = "Setting" if requirement.clear_bits else "Failsafe"
    hint = f"{_correction(requirement, parameter, value)} in the autopilot; Gainline does not change it."
    passed = requirement.may_lack if value is None else requirement.is_met(value)
    found = "not reported" if value is None else f"{value:g}{off}"
    return CheckItem(
        name=f"failsafe {requirement.parameter}",
        title=f"{kind} {parameter}",
        passed=passed,
        found=found,
        needed=requirement.what,
        hint="" if passed else hint,
    )


def _correction(requirement: Requirement, parameter: str, value: float | None) -> str:
    """How to correct a parameter that holds this value: what to subtract or add where only some of its bits count."""
    held = 0 if value is None else int(value)
    if surplus := held & requirement.clear_bits:
        return f"Subtract {surplus} from {parameter}"
    if held > 0 and (missing := requirement.bits & ~held):
        return f"Add {missing} to {parameter}"
    return f"Set {parameter}"
