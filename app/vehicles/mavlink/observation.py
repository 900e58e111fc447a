"""Observation of a vehicle during a trial by its monitors, as pure functions.

No single message may end the control of the vehicle. A disarming, a change of mode or a reboot counts only if two
messages apart in time confirm it and none between them contradicts.
"""

import math
from dataclasses import dataclass
from typing import Final

from app.autopilots.measurements import (
    Attitude,
    Battery,
    BlockEntered,
    FenceBreach,
    Heartbeat,
    InvalidPosition,
    LandedState,
    Measurement,
    Position,
)
from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.failures import DRIFT_M, GROUND_M, Finding
from app.vehicles.mavlink.monitors.altitude import PositionMonitor, SecondSourceMonitor
from app.vehicles.mavlink.monitors.clock import ATTENDED_S, ClockMonitor, LinkMonitor, unwrapped
from app.vehicles.mavlink.monitors.ground import AGREED_S, STANDS_S, ClimbMonitor, GroundMonitor
from app.vehicles.mavlink.monitors.limits import BatteryMonitor, EnvelopeMonitor
from app.vehicles.mavlink.monitors.modes import IdentityMonitor, ModeMonitor
from app.vehicles.mavlink.plan import Plan, replace

_DRIFT_M_S: Final = 0.5
"""Greatest rate of a drift of the altitude on the ground; 0.36 m/s were recorded under PX4."""


@dataclass(frozen=True, kw_only=True)
class TrialObservation:
    """State of a vehicle by its messages so far, monitor by monitor."""

    link: LinkMonitor
    clock: ClockMonitor
    positions: PositionMonitor
    battery: BatteryMonitor
    modes: ModeMonitor
    ground: GroundMonitor
    envelope: EnvelopeMonitor
    climb: ClimbMonitor
    second: SecondSourceMonitor
    identity: IdentityMonitor

    @property
    def last(self) -> Position | None:
        """The newest plausible position."""
        return self.positions.last


def begin(
    now_s: float,
    *,
    last: Position | None = None,
    battery_v: float | None = None,
    stood_s: float = 0.0,
    reports_landing: bool = False,
) -> TrialObservation:
    """Begin an observation with all times now. `last` is the position at which the vehicle has stood for `stood_s`;
    `reports_landing`: it has sent its landed state before, without which a landing is then not believed."""
    return TrialObservation(
        link=LinkMonitor(received_s=now_s),
        clock=ClockMonitor(advanced_s=now_s),
        positions=PositionMonitor(accepted_s=now_s, sent_s=now_s, last=last),
        battery=BatteryMonitor(heard_s=now_s, voltage_v=battery_v),
        modes=ModeMonitor(heartbeat_s=now_s),
        ground=GroundMonitor(
            landed=True if reports_landing else None,
            landed_s=-math.inf,
            grounded_since_s=None if last is None else now_s - stood_s,
        ),
        envelope=EnvelopeMonitor(origin=last),
        climb=ClimbMonitor(),
        second=SecondSourceMonitor(),
        identity=IdentityMonitor(),
    )


def reset_altitude(watch: TrialObservation) -> TrialObservation:
    """Return the observation of a vehicle on the ground whose altitude was reset, without its earlier altitudes."""
    return replace(
        watch,
        positions=replace(watch.positions, jumped_m=0.0),
        climb=replace(watch.climb, lifted=False, unseen_m=None, behind_m=0.0),
        envelope=replace(watch.envelope, side=-1, crossings=0),
        second=replace(watch.second, apart_m=0.0, apart_since_s=None),
    )


def begin_climb(watch: TrialObservation, altitude_m: float) -> TrialObservation:
    """Return the observation of a vehicle that is about to be commanded to take off from this altitude."""
    climb = replace(watch.climb, behind_m=0.0, highest_m=altitude_m)
    return replace(watch, climb=climb, clock=replace(watch.clock, stepped_s=0.0))


def change_set_point(watch: TrialObservation, set_point_m: float) -> TrialObservation:
    """Return the observation of a vehicle that is to fly to another set point, on whose one side it is now."""
    is_above = watch.last is not None and watch.last.altitude_m > set_point_m
    return replace(watch, envelope=replace(watch.envelope, side=1 if is_above else -1, may_overshoot=True))


def update(
    watch: TrialObservation, measurement: Measurement | None, now_s: float, plan: Plan
) -> tuple[TrialObservation, tuple[Position, ...]]:
    """Return the observation after one packet (None: one without a measurement), and the positions that it confirms."""
    stuck_s = watch.clock.stuck_s + min(now_s - watch.link.received_s, ATTENDED_S)
    watch = replace(watch, link=replace(watch.link, received_s=now_s), clock=replace(watch.clock, stuck_s=stuck_s))
    match measurement:
        case Position():
            return _add_position(watch, measurement, now_s, plan)
        case InvalidPosition(time_boot_s=time_boot_s) if watch.last is None or time_boot_s > watch.last.time_boot_s:
            watch = replace(watch, clock=replace(watch.clock, advanced_s=now_s, stuck_s=0.0))
        case Attitude(lean_rad=lean_rad):
            watch = replace(watch, envelope=watch.envelope.add_attitude(lean_rad, now_s))
        case Heartbeat():
            watch = replace(watch, modes=watch.modes.update(measurement, now_s, plan))
        case Battery(voltage_v=float(volts)):
            watch = replace(watch, battery=watch.battery.update(volts, now_s, plan))
        case FenceBreach(limit=limit):
            watch = replace(watch, envelope=replace(watch.envelope, breached=limit or "some limit"))
        case LandedState(on_ground=landed):
            watch = replace(watch, ground=watch.ground.update(landed, now_s))
        case BlockEntered(number=number):
            block = plan.blocks.get(number, str(number))
            watch = replace(watch, modes=replace(watch.modes, block=block, block_s=now_s))
    return watch, ()


def _add_position(
    watch: TrialObservation, position: Position, now_s: float, plan: Plan
) -> tuple[TrialObservation, tuple[Position, ...]]:
    newest, last = watch.positions.doubted or watch.last, watch.last
    position = unwrapped(position, newest)
    if newest is not None and not watch.clock.continues(position, newest, now_s):
        clock, has_rebooted = watch.clock.add_other(position, newest, now_s)
        watch = replace(watch, clock=clock)
        if has_rebooted:
            positions, identity = watch.positions.restart(position, now_s), replace(watch.identity, rebooted=True)
            watch = replace(watch, positions=positions, identity=identity)
        return watch, ()
    clock = watch.clock.advance(position, now_s)
    sent_s, quiet_s = clock.sent_s(position), now_s - watch.clock.advanced_s
    positions, confirmed = watch.positions.update(position, now_s, sent_s, quiet_s)
    if not confirmed:
        return replace(watch, clock=clock, positions=positions), ()
    watch = replace(
        watch,
        clock=clock if clock.other is None else replace(clock, other=None),
        positions=positions,
        climb=watch.climb.update(last, position),
        envelope=watch.envelope.add_position(position, plan),
    )
    return watch, confirmed


def note_duplicate(watch: TrialObservation, reason: str) -> TrialObservation:
    """Return the observation after evidence that two vehicles use its system id."""
    return replace(watch, identity=replace(watch.identity, duplicate_reason=reason))


def update_secondary(watch: TrialObservation, sample: SecondaryAltitudeReceived) -> TrialObservation:
    """Return the observation after a sample of the second source of altitude."""
    vehicle_m = watch.last.altitude_m if watch.last is not None and watch.positions.is_fresh(sample.now_s) else None
    return replace(watch, second=watch.second.update(sample, vehicle_m))


def settle(watch: TrialObservation, now_s: float, plan: Plan, *, commanded: bool) -> TrialObservation:
    """Note since when every source shows it on the ground: its position by height and speed, the landed state that it
    reports, and the second source of altitude. A single sample that jumps is ignored. Before it is `commanded` to take
    off, its landed state or its block is believed rather than an altitude that drifts."""
    positions, ground_m = watch.positions, plan.ground_m
    if positions.is_in_doubt(now_s):
        return watch
    stands = not commanded and stands_by_own_account(watch, now_s, plan)
    airborne = positions.is_airborne(now_s, ground_m) and not stands
    grounded, said_to_fly = stands or positions.is_grounded(now_s, ground_m), is_said_to_fly(watch, now_s, ground_m)
    climb = watch.climb.settle(ground_m, airborne=airborne)
    ground = watch.ground.settle(now_s, grounded=grounded, said_to_fly=said_to_fly)
    return watch if climb is watch.climb and ground is watch.ground else replace(watch, climb=climb, ground=ground)


# ---- conclusions from more than one monitor


def is_said_to_fly(watch: TrialObservation, now_s: float, ground_m: float) -> bool:
    """Whether its own landed state or the second source shows it in the air, independent of its altitude."""
    second_m = watch.second.altitude_at(now_s)
    return watch.ground.reports(now_s, landed=False) or (second_m is not None and second_m - ground_m > GROUND_M)


def has_reported_landing(watch: TrialObservation, now_s: float, plan: Plan) -> bool:
    """Whether it has reported for a second that it is on the ground, by its landed state or the block of its plan."""
    if watch.modes.block in plan.autopilot.landed_blocks:
        return now_s - watch.modes.block_s >= AGREED_S
    return watch.ground.has_reported_landing(now_s)


def stands_by_own_account(watch: TrialObservation, now_s: float, plan: Plan) -> bool:
    """Whether it reports that it is on the ground, or in a block of its plan that has no thrust, and its altitude has
    not drifted further than one may, nor faster. To be called for a vehicle that was not commanded to take off."""
    last = watch.last
    stays = last is None or abs(last.altitude_m - plan.ground_m) <= DRIFT_M
    stays = stays and (last is None or abs(last.climb_rate_m_s) <= _DRIFT_M_S)
    stands = watch.ground.reports(now_s, landed=True, within_s=STANDS_S)
    return stays and (stands or watch.modes.block in plan.autopilot.arming_blocks)


def find_doubt_of_ground(watch: TrialObservation, now_s: float) -> str:
    """Return why it may not be on the ground; empty once every source has shown it there for a second, if its altitude
    has never jumped."""
    since_s = watch.ground.grounded_since_s
    if watch.identity.duplicate_reason:
        return "two vehicles may be using its system id"
    if watch.identity.rebooted:
        return "it rebooted during the flight"
    if watch.positions.jumped_m:
        return "its altitude jumped during the flight"
    if watch.climb.is_behind:
        return "its altitude did not follow its climb rate"
    if since_s is None or now_s - since_s < AGREED_S:
        return f"not every source has shown it on the ground for {AGREED_S:g} s"
    return ""


def find_on_ground(watch: TrialObservation, plan: Plan, now_s: float) -> Finding | None:
    """Return the most severe failure of a vehicle before the takeoff command, if any."""
    return (
        watch.identity.find_reboot()
        or watch.envelope.find_oscillation()
        or watch.identity.find_duplicate()
        or watch.link.find(plan, watch.modes.heartbeat_s, now_s)
        or find_frozen(watch, plan, now_s)
        or find_lost_position(watch, plan, now_s)
        or watch.battery.find(now_s)
    )


def find_frozen(watch: TrialObservation, plan: Plan, now_s: float) -> Finding | None:
    return (
        watch.clock.find_frozen(plan, watch.last, watch.positions.accepted_s)
        or watch.positions.find_frozen()
        or watch.second.find_blind(plan, now_s)
    )


def find_lost_position(watch: TrialObservation, plan: Plan, now_s: float) -> Finding | None:
    """Find a lost position; to be called after a lost link was looked for, because silence is one."""
    return (
        watch.positions.find_implausible(plan, watch.link.received_s, now_s)
        or watch.clock.find_late(plan)
        or watch.positions.find_unreliable()
    )
