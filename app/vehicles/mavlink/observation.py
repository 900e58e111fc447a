"""Observation of a vehicle during a trial by its monitors.

No single message may end the control of the vehicle. A disarming, a change of mode or a reboot counts only if two
messages apart in time confirm it and none between them contradicts.
"""

import math
from dataclasses import dataclass, replace
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
from app.vehicles.mavlink.monitors.clock import ATTENDED_S, ClockMonitor, unwrapped
from app.vehicles.mavlink.monitors.ground import AGREED_S, STANDS_S, ClimbMonitor, GroundMonitor
from app.vehicles.mavlink.monitors.limits import BatteryMonitor, EnvelopeMonitor, LinkMonitor
from app.vehicles.mavlink.monitors.modes import IdentityMonitor, ModeMonitor
from app.vehicles.mavlink.plan import Plan

_DRIFT_M_S: Final = 0.5
"""Greatest rate of a drift of the altitude on the ground; 0.36 m/s were recorded under PX4."""


@dataclass(frozen=True, kw_only=True)
class TrialObservation:
    """Frozen state of a vehicle by its messages so far, monitor by monitor."""

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
    def last(self) -> Position:
        """The newest plausible position."""
        return self.positions.last

    @classmethod
    def begin(
        cls,
        now_s: float,
        *,
        last: Position,
        battery_v: float | None = None,
        stood_s: float = 0.0,
        reports_landing: bool = False,
    ) -> "TrialObservation":
        """Begin an observation with all times now. `last` is the position at which the vehicle has stood for `stood_s`;
        `reports_landing`: it has sent its landed state before, without which a landing is then not believed."""
        return cls(
            link=LinkMonitor(received_s=now_s),
            clock=ClockMonitor(advanced_s=now_s),
            positions=PositionMonitor(accepted_s=now_s, sent_s=now_s, last=last),
            battery=BatteryMonitor(heard_s=now_s, voltage_v=battery_v),
            modes=ModeMonitor(heartbeat_s=now_s),
            ground=GroundMonitor(
                landed=True if reports_landing else None,
                landed_s=-math.inf,
                grounded_since_s=now_s - stood_s,
            ),
            envelope=EnvelopeMonitor(origin=last),
            climb=ClimbMonitor(),
            second=SecondSourceMonitor(),
            identity=IdentityMonitor(),
        )

    def reset_altitude(self) -> "TrialObservation":
        """Return the observation of a vehicle on the ground whose altitude was reset, without its earlier altitudes."""
        return replace(
            self,
            positions=replace(self.positions, jumped_m=0.0),
            climb=replace(self.climb, lifted=False, unseen_m=None, behind_m=0.0),
            envelope=replace(self.envelope, side=-1, crossings=0),
            second=replace(self.second, apart_m=0.0, apart_since_s=None),
        )

    def begin_climb(self, altitude_m: float) -> "TrialObservation":
        """Return the observation of a vehicle that is about to be commanded to take off from this altitude."""
        climb = replace(self.climb, behind_m=0.0, highest_m=altitude_m)
        return replace(self, climb=climb, clock=replace(self.clock, stepped_s=0.0))

    def change_set_point(self, set_point_m: float) -> "TrialObservation":
        """Return the observation of a vehicle that is to fly to another set point, on whose one side it is now."""
        side = 1 if self.last.altitude_m > set_point_m else -1
        return replace(self, envelope=replace(self.envelope, side=side, may_overshoot=True))

    def update(
        self, measurement: Measurement | None, now_s: float, plan: Plan
    ) -> tuple["TrialObservation", tuple[Position, ...]]:
        """Return the observation after one packet (None: one without a measurement), and the positions that it
        confirms."""
        stuck_s = self.clock.stuck_s + min(now_s - self.link.received_s, ATTENDED_S)
        watch = replace(self, link=replace(self.link, received_s=now_s), clock=replace(self.clock, stuck_s=stuck_s))
        match measurement:
            case Position():
                return watch._add_position(measurement, now_s, plan)
            case InvalidPosition(time_boot_s=time_boot_s) if time_boot_s > watch.last.time_boot_s:
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
        self, position: Position, now_s: float, plan: Plan
    ) -> tuple["TrialObservation", tuple[Position, ...]]:
        newest, last = self.positions.doubted or self.last, self.last
        position = unwrapped(position, newest)
        if not self.clock.continues(position, newest, now_s):
            clock, has_rebooted = self.clock.add_other(position, newest, now_s)
            if not has_rebooted:
                return replace(self, clock=clock), ()
            positions, identity = self.positions.restart(position, now_s), replace(self.identity, rebooted=True)
            return replace(self, clock=clock, positions=positions, identity=identity), ()
        clock = self.clock.advance(position, now_s)
        sent_s, quiet_s = clock.sent_s(position), now_s - self.clock.advanced_s
        positions, confirmed = self.positions.update(position, now_s, sent_s, quiet_s)
        if not confirmed:
            return replace(self, clock=clock, positions=positions), ()
        accepted = replace(
            self,
            clock=clock if clock.other is None else replace(clock, other=None),
            positions=positions,
            climb=self.climb.update(last, position),
            envelope=self.envelope.add_position(position, plan),
        )
        return accepted, confirmed

    def note_duplicate(self, reason: str) -> "TrialObservation":
        """Return the observation after evidence that two vehicles use its system id."""
        return replace(self, identity=replace(self.identity, duplicate_reason=reason))

    def update_secondary(self, sample: SecondaryAltitudeReceived) -> "TrialObservation":
        """Return the observation after a sample of the second source of altitude."""
        vehicle_m = self.last.altitude_m if self.positions.is_fresh(sample.now_s) else None
        return replace(self, second=self.second.update(sample, vehicle_m))

    def settle(self, now_s: float, plan: Plan, *, commanded: bool) -> "TrialObservation":
        """Note since when every source shows it on the ground: its position by height and speed, the landed state that
        it reports, and the second source of altitude. A single sample that jumps is ignored. Before it is `commanded`
        to take off, its landed state or its block is believed rather than an altitude that drifts."""
        positions, ground_m = self.positions, plan.ground_m
        if positions.is_in_doubt(now_s):
            return self
        stands = not commanded and self.stands_by_own_account(now_s, plan)
        airborne = positions.is_airborne(now_s, ground_m) and not stands
        grounded, said_to_fly = stands or positions.is_grounded(now_s, ground_m), self.is_said_to_fly(now_s, ground_m)
        climb = self.climb.settle(ground_m, airborne=airborne)
        ground = self.ground.settle(now_s, grounded=grounded, said_to_fly=said_to_fly)
        return self if climb is self.climb and ground is self.ground else replace(self, climb=climb, ground=ground)

    # ---- conclusions from more than one monitor

    def is_said_to_fly(self, now_s: float, ground_m: float) -> bool:
        """Whether its own landed state or the second source shows it in the air, independent of its altitude."""
        second_m = self.second.altitude_at(now_s)
        return self.ground.reports(now_s, landed=False) or (second_m is not None and second_m - ground_m > GROUND_M)

    def has_reported_landing(self, now_s: float, plan: Plan) -> bool:
        """Whether it has reported for a second that it is on the ground, by its landed state or the block of its
        plan."""
        if self.modes.block in plan.autopilot.landed_blocks:
            return now_s - self.modes.block_s >= AGREED_S
        return self.ground.has_reported_landing(now_s)

    def stands_by_own_account(self, now_s: float, plan: Plan) -> bool:
        """Whether it reports that it is on the ground, or in a block of its plan that has no thrust, and its altitude
        has not drifted further than one may, nor faster. To be called for a vehicle that was not commanded to take
        off."""
        stays = abs(self.positions.height_m(plan.ground_m)) <= DRIFT_M and abs(self.last.climb_rate_m_s) <= _DRIFT_M_S
        stands = self.ground.reports(now_s, landed=True, within_s=STANDS_S)
        return stays and (stands or self.modes.block in plan.autopilot.arming_blocks)

    def find_doubt_of_ground(self, now_s: float) -> str:
        """Return why it may not be on the ground; empty once every source has shown it there for a second, if its
        altitude has never jumped."""
        since_s = self.ground.grounded_since_s
        if self.identity.duplicate_reason:
            return "two vehicles may be using its system id"
        if self.identity.rebooted:
            return "it rebooted during the flight"
        if self.positions.jumped_m:
            return "its altitude jumped during the flight"
        if self.climb.is_behind:
            return "its altitude did not follow its climb rate"
        if since_s is None or now_s - since_s < AGREED_S:
            return f"not every source has shown it on the ground for {AGREED_S:g} s"
        return ""

    def find_on_ground(self, plan: Plan, now_s: float) -> Finding | None:
        """Return the most severe failure of a vehicle before the takeoff command, if any."""
        return (
            self.identity.find_reboot()
            or self.envelope.find_oscillation()
            or self.identity.find_duplicate()
            or self.link.find(plan, self.modes.heartbeat_s, now_s)
            or self.find_frozen(plan, now_s)
            or self.find_lost_position(plan, now_s)
            or self.battery.find(now_s)
        )

    def find_frozen(self, plan: Plan, now_s: float) -> Finding | None:
        return (
            self.clock.find_frozen(plan, self.last, self.positions.accepted_s)
            or self.positions.find_frozen()
            or self.second.find_blind(plan, now_s)
        )

    def find_lost_position(self, plan: Plan, now_s: float) -> Finding | None:
        """Find a lost position; to be called after a lost link was looked for, because silence is one."""
        return (
            self.positions.find_implausible(plan, self.link.received_s, now_s)
            or self.clock.find_late(plan)
            or self.positions.find_unreliable()
        )
