"""Whole trials over a hostile link: every hostility from every state of a trial on, under every autopilot.

The judgement asks what nobody may ever see, whatever the link says: motors stopped in the air, a vehicle that is left,
one that rises beyond its ceiling, or a record and a verdict that are not what happened.
"""

import random
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from app.core.trajectory import Trajectory
from app.vehicles.base import FlightOptions, FlightRecord, Sample
from app.vehicles.errors import SafeGainsError, VehicleError
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from bench.hazards.cases import ABORT, SAFE, Case, Mishap, tuned_gains
from bench.hazards.hostility import HOSTILITIES, Hostility, Speaker
from bench.hazards.rig import Rig
from bench.hazards.stages import LIFTED_M, Stage
from bench.hazards.wire import DIALECTS, Order

FOR_GOOD_S: Final = float("inf")
SHORT_S: Final = 1.5
CEILING_M: Final = 5.5
"""The limit of altitude, and a metre."""
COMES_DOWN_WITHIN_S: Final = 60.0
"""After the trial, with the program attending to the vehicle."""
RECORD_WITHIN_M: Final = 0.35
_AIR: Final = (Stage.TAKEOFF, Stage.RECORD, Stage.LAND)


@dataclass(frozen=True, slots=True)
class Ended:
    """What came of a case; `wrong` is what may never be."""

    outcome: str
    vehicle: str
    reason: str
    struck: str
    wrong: tuple[str, ...]


def cases(first: int = 0) -> list[Case]:
    """For good in every state, and for a second and a half in the air; seeds count up from `first`."""
    whole = [(name, stage, FOR_GOOD_S) for name, stage in product(HOSTILITIES, Stage)]
    brief = [(name, stage, SHORT_S) for name, stage in product(HOSTILITIES, _AIR)]
    drawn = product(SAFE, [*whole, *brief])
    return [_case(first + seed, autopilot, *what) for seed, (autopilot, what) in enumerate(drawn)]


def _case(seed: int, autopilot: str, name: str, stage: Stage, duration_s: float) -> Case:
    chance = random.Random(seed)
    hostile = Mishap(name, stage, chance.uniform(0.0, 0.8), duration_s)
    leads: dict[Stage, Mishap] = {
        Stage.ABORT_LAND: Mishap(ABORT, Stage.RECORD, chance.uniform(0.3, 6.0)),
        Stage.LINK_LOST: Mishap("link-lost", Stage.RECORD, chance.uniform(0.3, 6.0), 5.0),
    }
    return Case(
        seed=seed,
        autopilot=autopilot,
        mishaps=(hostile, *([leads[stage]] if stage in leads else [])),
        gains=tuned_gains(chance, autopilot),
        warm_s=5.0,
        waits_s=0.0,
        pinned=chance.random() < 0.5,
    )


class HostileRig(Rig):
    """`heights` are the drone's true ones, s since it was switched on."""

    def __init__(self, case: Case) -> None:
        self.acting: list[tuple[Hostility, float]] = []
        self.heights: list[tuple[float, float]] = []
        super().__init__(case)
        self._speaker = Speaker(case.autopilot, DIALECTS[case.autopilot], self.drone, random.Random(case.seed))

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        now_s = self.drone.time_s
        for hostility, until_s in self.acting:
            if now_s < until_s:
                frames = hostility.arrive(frames, now_s)
        return frames

    def tick(self) -> None:
        super().tick()
        self.heights.append((self.drone.time_s, self.drone.body.altitude_m))

    def _strike(self, mishap: Mishap, now_s: float) -> None:
        make = HOSTILITIES.get(mishap.kind)
        if make is None:
            super()._strike(mishap, now_s)
        else:
            self.acting.append((make(self._speaker), now_s + mishap.duration_s))


def carry_out(case: Case) -> Ended:
    """Raises what the simulated drone raised, when it broke down."""
    rig = HostileRig(case)
    rig.wait_s(case.warm_s)
    rig.stages.begin(rig.now_s())
    try:
        vehicle = MavlinkVehicle(rig.options(), case.safe, is_real=False, clock=rig, transport=rig, observes=True)
    except VehicleError as error:
        return _ended(rig, "refused", "unopened", str(error), None)
    try:
        return _flown(rig, vehicle)
    finally:
        vehicle.close()


def _flown(rig: HostileRig, vehicle: MavlinkVehicle) -> Ended:
    record: FlightRecord | None = None
    outcome = "refused"
    try:
        held = vehicle.stage(rig.case.gains)
        if held != rig.case.gains:
            raise VehicleError(f"it holds {held}", hint="")
        record = vehicle.fly(FlightOptions(seed=1), on_sample=_unwatched, should_stop=lambda: rig.wanted)
        outcome, reason = str(record.ending), record.reason
    except VehicleError as error:
        reason = str(error)
    rig.stages.over_s = rig.drone.time_s
    said = _leave(rig, vehicle)
    vehicle.attend(COMES_DOWN_WITHIN_S)
    return _ended(rig, outcome, said, reason, None if record is None else record.trajectory)


def _leave(rig: HostileRig, vehicle: MavlinkVehicle) -> str:
    """What the program says of the vehicle, after what everybody does on any exit."""
    try:
        held = vehicle.stage(rig.case.safe)
    except SafeGainsError:
        return "quarantined"
    except VehicleError:
        return "safe" if not vehicle.concern else "quarantined"
    return "safe" if held == rig.case.safe else "quarantined"


def _ended(rig: HostileRig, outcome: str, vehicle: str, reason: str, record: Trajectory | None) -> Ended:
    first = rig.case.mishaps[0]
    struck = f"{first.kind} from {first.stage} on, for {first.duration_s:g} s"
    return Ended(outcome, vehicle, reason, struck, judge(rig, outcome, vehicle, record))


def judge(rig: HostileRig, outcome: str, vehicle: str, record: Trajectory | None) -> tuple[str, ...]:
    """What may never be, of what was said of a trial and its vehicle."""
    drone = rig.drone
    wrong: list[str] = []
    stops = [stop.height_m for stop in rig.stops if stop.height_m > LIFTED_M]
    if stops:
        wrong.append(f"its motors were told to stop at {max(stops):.2f} m")
    if drone.body.altitude_m > LIFTED_M:
        wrong.append(f"it was left at {drone.body.altitude_m:.2f} m")
    if (highest_m := max((height_m for _, height_m in rig.heights), default=0.0)) > CEILING_M:
        wrong.append(f"it rose to {highest_m:.2f} m")
    if vehicle == "safe" and (drone.autopilot.armed or not rig.holds(rig.case.safe)):
        wrong.append(f"it is said to be safe, and is {'armed' if drone.autopilot.armed else 'not on its safe gains'}")
    wrong += _gaps(rig)
    if outcome == "completed" and record is not None:
        wrong += _untrue(rig, record)
    return tuple(wrong)


def _gaps(rig: HostileRig) -> Iterator[str]:
    """After its trial a vehicle in the air is told to land, again and again."""
    over_s = rig.stages.over_s
    airborne = [at_s for at_s, height_m in rig.heights if at_s > over_s and height_m > LIFTED_M]
    if not airborne or not rig.drone.autopilot.armed:
        return
    lands = [at_s for at_s in rig.stages.ordered(Order.LAND) if at_s <= airborne[-1]]
    if not lands:
        yield "it was left in the air without Land"


def _untrue(rig: HostileRig, record: Trajectory) -> Iterator[str]:
    """A record that counts is where the vehicle truly was: compared where it hovers, and as a whole."""
    took_off_s = rig.stages.first_s(Stage.TAKEOFF)
    if took_off_s is None:
        yield "a record of a flight that never was"
        return
    times_s, heights_m = (np.array(column) for column in zip(*rig.heights, strict=True))
    true_m = np.interp(record.time_s + took_off_s, times_s, heights_m)
    apart_m = np.abs(record["altitude_m"] - true_m - (record["altitude_m"][0] - true_m[0]))
    hovering = record.time_s > 10.0
    if apart_m[hovering].max() > RECORD_WITHIN_M:
        yield f"its record counts, and is {apart_m[hovering].max():.2f} m from where it was"


def _unwatched(_sample: Sample) -> None:
    pass
