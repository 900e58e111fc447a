"""One trial with faults: connect, stage and fly with the program's own vehicle class, and record the result."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from app.autopilots.registry import get_experiment
from app.vehicles.base import FlightOptions, FlightRecord, SafeGainsError, Sample, VehicleError
from app.vehicles.flight_end import Failure
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mavlink_kind import open_source
from bench.hazards.cases import Case
from bench.hazards.rig import InjectedFault, MotorStop, Overridden, Rig
from bench.hazards.trial_states import TrialStates

_STEPS: Final = 4
_STEPS_OF: Final = {
    "paparazzi": "altitude-steps",
    "ardupilot": "altitude-steps-ardupilot",
    "px4": "altitude-steps-px4",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """Result of a case.

    `outcome` is completed, aborted, invalid, or refused: nothing was flown. `has_record`: the vehicle returned a
    record, of a flight or of one that ended before the lift-off. `vehicle` is what the program reports afterwards:
    safe, quarantined, or unopened (never connected). The rest is the drone's true state: `flew_on` are the gains that
    it held at lift-off, `rose_m` how far it has risen from where it stood, `impact_m_s` its fastest descent within half
    a metre of the ground, `touched_down_s` when it was last off the ground.
    """

    outcome: str
    has_record: bool
    vehicle: str
    reason: str
    holds_safe: bool
    held: Mapping[str, float]
    flew_on: Mapping[str, float] | None
    armed: bool
    height_m: float
    rose_m: float
    impact_m_s: float
    touched_down_s: float
    packets: int
    stops: tuple[MotorStop, ...]
    injected: tuple[InjectedFault, ...]
    states: TrialStates = field(repr=False)
    overridden: tuple[Overridden, ...] = ()
    failure: Failure | None = None


def run_trial(case: Case) -> TrialResult:
    """Run the trial of a case. An exception in the simulated drone propagates."""
    rig = Rig(case)
    rig.wait_s(case.powered_s)
    rig.close()  # what was sent before the connection does not arrive
    rig.states.begin(rig.now_s())
    return _connect_and_fly(rig)


def _connect_and_fly(rig: Rig) -> TrialResult:
    try:
        source = open_source("odometry", rig) if rig.case.has_second_source else None
        vehicle = MavlinkVehicle(rig.options(), rig.case.safe, is_real=False, clock=rig, source=source, transport=rig)
    except VehicleError as error:
        rig.states.ended_s = rig.drone.time_s
        return _end(rig, None, "unopened", str(error))
    try:
        return _fly(rig, vehicle)
    finally:
        vehicle.close()


def _fly(rig: Rig, vehicle: MavlinkVehicle) -> TrialResult:
    try:
        record, reason = _stage_and_fly(rig, vehicle)
    except VehicleError as error:
        record, reason = None, str(error)
    rig.states.ended_s = rig.drone.time_s
    left = _end(rig, record, "safe", reason)
    failure = _restore_safe_gains(vehicle, rig.case.safe)
    if record is None:
        return _end(rig, record, "safe" if failure is None else "quarantined", reason)
    return replace(left, vehicle="quarantined") if isinstance(failure, SafeGainsError) else left


def _end(rig: Rig, record: FlightRecord | None, vehicle: str, reason: str) -> TrialResult:
    """Return the result with the present state of the drone."""
    drone = rig.drone
    return TrialResult(
        outcome=outcome_of(record),
        has_record=record is not None,
        vehicle=vehicle,
        reason=reason,
        holds_safe=rig.holds(rig.case.safe),
        held=rig.held(),
        flew_on=rig.flew_on,
        armed=drone.autopilot.armed,
        height_m=drone.body.altitude_m,
        rose_m=rig.rose_m,
        impact_m_s=rig.impact_m_s,
        touched_down_s=rig.touched_down_s,
        packets=rig.packets,
        stops=tuple(rig.stops),
        injected=tuple(rig.injected),
        states=rig.states,
        overridden=tuple(rig.overridden),
        failure=None if record is None else record.end.failure,
    )


def _restore_safe_gains(vehicle: MavlinkVehicle, safe: Mapping[str, float]) -> VehicleError | None:
    """Stage the safe gains again, as `open_vehicle` does on every exit, and return the error if that fails.

    After a trial with a record this changes nothing: it has restored the safe gains itself or quarantined the vehicle.
    """
    try:
        held = vehicle.stage(safe)
    except VehicleError as error:
        return error
    return None if held == safe else SafeGainsError(f"it holds {held}", hint="")


def outcome_of(record: FlightRecord | None) -> str:
    """Return the outcome of a trial, which has no record if it raised an error."""
    return record.ending if record is not None and record.has_flown else "refused"


def _stage_and_fly(rig: Rig, vehicle: MavlinkVehicle) -> tuple[FlightRecord | None, str]:
    held = vehicle.stage(rig.case.gains)
    if held != rig.case.gains:
        return None, f"it holds {held}"
    rig.wait_s(rig.case.staged_s)
    record = vehicle.fly(_order(rig.case), on_sample=_ignore_sample, should_stop=rig.decide)
    return record, record.reason


def _order(case: Case) -> FlightOptions:
    """Return the order for a takeoff, or for altitude steps of the same length."""
    order = FlightOptions(seed=1, window_s=case.window_s)
    if not case.flies_steps:
        return order
    name = _STEPS_OF[case.autopilot]
    step_s = (order.window_s - get_experiment(name).scored_from_s) / _STEPS
    set_points = get_experiment(name, {"steps": _STEPS, "step_window_s": step_s}).set_points
    return order if set_points is None else replace(order, set_points=set_points)


def _ignore_sample(_sample: Sample) -> None:
    pass
