"""Carries out one case: connect, stage, fly, as the program does it, and records the outcome."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from app.vehicles.base import FlightOptions, SafeGainsError, Sample, VehicleError
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mocap.opening import open_source
from bench.hazards.cases import Case
from bench.hazards.rig import Rig, Stopping, Struck
from bench.hazards.stages import Stages


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """Outcome of a case. `outcome`: completed, aborted, invalid (a record was left) or refused (nothing flew).
    `vehicle`: what the program says of it afterwards: safe, quarantined, or unopened (it never had control).
    `flew_on`: the gains that it truly held when it left the ground; `impact_m_s`: the fastest that it truly sank within
    half a metre of the ground."""

    outcome: str
    vehicle: str
    reason: str
    holds_safe: bool
    held: Mapping[str, float]
    flew_on: Mapping[str, float] | None
    armed: bool
    height_m: float
    impact_m_s: float
    packets: int
    stops: tuple[Stopping, ...]
    struck: tuple[Struck, ...]
    stages: Stages = field(repr=False)


def carry_out(case: Case) -> Flown:
    """Raises what the simulated drone raised, when it broke down."""
    rig = Rig(case)
    rig.wait_s(case.warm_s)
    rig.stages.begin(rig.now_s())
    return _try(rig)


def _try(rig: Rig) -> Flown:
    try:
        source = open_source("odometry", rig) if rig.case.has_second_source else None
        vehicle = MavlinkVehicle(rig.options(), rig.case.safe, is_real=False, clock=rig, source=source, transport=rig)
    except VehicleError as error:
        rig.stages.over_s = rig.drone.time_s
        return _end(rig, "refused", "unopened", str(error))
    try:
        return _fly(rig, vehicle)
    finally:
        vehicle.close()


def _fly(rig: Rig, vehicle: MavlinkVehicle) -> Flown:
    try:
        outcome, reason = _staged_and_flown(rig, vehicle)
    except VehicleError as error:
        outcome, reason = "refused", str(error)
    rig.stages.over_s = rig.drone.time_s
    left = _end(rig, outcome, "safe", reason)
    said = _leave(vehicle, rig.case.safe)
    if outcome == "refused":
        return _end(rig, outcome, "safe" if said is None else "quarantined", reason)
    return replace(left, vehicle="quarantined") if isinstance(said, SafeGainsError) else left


def _end(rig: Rig, outcome: str, vehicle: str, reason: str) -> Flown:
    """What is so now."""
    drone = rig.drone
    return Flown(
        outcome=outcome,
        vehicle=vehicle,
        reason=reason,
        holds_safe=rig.holds(rig.case.safe),
        held=rig.held(),
        flew_on=rig.flew_on,
        armed=drone.autopilot.armed,
        height_m=drone.body.altitude_m,
        impact_m_s=rig.impact_m_s,
        packets=rig.heard,
        stops=tuple(rig.stops),
        struck=tuple(rig.struck),
        stages=rig.stages,
    )


def _leave(vehicle: MavlinkVehicle, safe: Mapping[str, float]) -> VehicleError | None:
    """What everybody does on any exit (`open_vehicle`): the safe gains once more, read back; what is said against it.
    A trial that left a record has done so itself already, or quarantined the vehicle."""
    try:
        held = vehicle.stage(safe)
    except VehicleError as error:
        return error
    return None if held == safe else SafeGainsError(f"it holds {held}", hint="")


def _staged_and_flown(rig: Rig, vehicle: MavlinkVehicle) -> tuple[str, str]:
    held = vehicle.stage(rig.case.gains)
    if held != rig.case.gains:
        return "refused", f"it holds {held}"
    rig.wait_s(rig.case.waits_s)
    record = vehicle.fly(FlightOptions(seed=1), on_sample=_unwatched, should_stop=lambda: rig.wanted)
    return record.ending, record.reason


def _unwatched(_sample: Sample) -> None:
    pass
