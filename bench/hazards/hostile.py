"""Whole trials over a hostile link, or with a vehicle that something befalls: every hazard from every state of a trial
on, under every autopilot. What may never be seen then is in `truth.py`."""

import random
from dataclasses import dataclass
from itertools import product
from typing import Final

from app.vehicles.base import FlightOptions, FlightRecord, SafeGainsError, Sample, VehicleError
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mocap.opening import open_source
from bench.hazards.cases import ABORT, FOR_GOOD_S, SAFE, Case, Mishap, tuned_gains
from bench.hazards.hostility import (
    HAZARDS,
    HOSTILITIES,
    MISFORTUNES,
    PILOTS,
    UPLINKS_S,
    Hostility,
    Speaker,
)
from bench.hazards.rig import Rig, Struck
from bench.hazards.stages import Stage
from bench.hazards.truth import Moment, ReportedOutcome, Truth, judge
from bench.hazards.wire import DIALECTS

SHORT_S: Final = 1.5
COMES_DOWN_WITHIN_S: Final = 60.0
"""After the trial, with the program attending to the vehicle."""
ATTENDED_S: Final = 5.0
HEARD_S: Final = 1.0
_MOMENT_TICKS: Final = 4
_AIR: Final = (Stage.TAKEOFF, Stage.RECORD, Stage.LAND)


@dataclass(frozen=True, slots=True)
class Ended:
    """Outcome of a case; `wrong` is what may never be."""

    outcome: str
    vehicle: str
    reason: str
    struck: str
    wrong: tuple[str, ...]


def cases(first: int = 0) -> list[Case]:
    """For good in every state, and for a second and a half in the air; seeds count up from `first`."""
    whole = [(name, stage, FOR_GOOD_S) for name, stage in product(HAZARDS, Stage)]
    brief = [(name, stage, SHORT_S) for name, stage in product(HAZARDS, _AIR)]
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
    """`moments` are where the drone truly was, from its switching on."""

    def __init__(self, case: Case) -> None:
        self.acting: list[tuple[Hostility, float]] = []
        self.moments: list[Moment] = []
        self._arrived_s = 0.0
        self._pilot_told_s: list[float] = []
        self._overruled_s = FOR_GOOD_S
        self._ticks = 0
        self._late_s, self._late_until_s = 0.0, 0.0
        self._under_way: list[tuple[float, bytes]] = []
        super().__init__(case)
        self._speaker = Speaker(case.autopilot, DIALECTS[case.autopilot], self.drone, random.Random(case.seed))

    def write(self, data: bytes) -> bool:
        """Deliver in the order of sending, late or not."""
        late_s = self._late_s if self.drone.time_s < self._late_until_s else 0.0
        self._under_way.append((self.drone.time_s + late_s, data))
        self._deliver()
        return True

    def _deliver(self) -> None:
        while self._under_way and self._under_way[0][0] <= self.drone.time_s:
            super().write(self._under_way.pop(0)[1])

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        now_s = self.drone.time_s
        for hostility, until_s in self.acting:
            if now_s < until_s:
                frames = hostility.arrive(frames, now_s)
        self._arrived_s = now_s if frames else self._arrived_s
        self._watch_pilot(frames, now_s)
        return frames

    def _watch_pilot(self, frames: list[bytes], now_s: float) -> None:
        """When heartbeats tell of a pilot after the take-off, and when it is taken from one who was told of."""
        flown = any(each.kind in PILOTS and each.begun_s < now_s < each.ended_s for each in self.struck)
        if not flown or self.stages.first_s(Stage.TAKEOFF) is None:
            return
        if self.drone.autopilot.is_by_hand:
            read = (self._speaker.read(frame) for frame in frames)
            beats = any(message is not None and message.get_type() == "HEARTBEAT" for message in read)
            self._pilot_told_s += [now_s] if beats else []
        elif self._pilot_told_s:
            self._overruled_s = min(self._overruled_s, now_s)

    def tick(self) -> None:
        super().tick()
        self._deliver()
        self._ticks += 1
        if self._ticks % _MOMENT_TICKS == 0:
            now_s, body = self.drone.time_s, self.drone.body
            is_heard = now_s - self._arrived_s < HEARD_S
            armed = self.drone.autopilot.armed
            self.moments.append(Moment(now_s, body.altitude_m, body.climb_rate_m_s, armed, is_heard))

    @property
    def truth(self) -> Truth:
        """So far."""
        return Truth(
            case=self.case,
            stages=self.stages,
            struck=self.struck,
            sent=self.sent,
            stops=self.stops,
            moments=self.moments,
            pilot_told_s=self._pilot_told_s,
            overruled_s=self._overruled_s,
            armed=self.drone.autopilot.armed,
            holds_safe=self.holds(self.case.safe),
        )

    def _strike(self, mishap: Mishap, now_s: float) -> None:
        stage = self.stages.now
        if stage is None or mishap.kind not in HAZARDS:
            return super()._strike(mishap, now_s)
        fault, most_s = MISFORTUNES.get(mishap.kind, ("", FOR_GOOD_S))
        lasts_s = min(mishap.duration_s, most_s)
        self.struck.append(Struck(mishap.kind, stage, now_s, now_s + lasts_s))
        if mishap.kind in UPLINKS_S:
            self._late_s, self._late_until_s = UPLINKS_S[mishap.kind], now_s + lasts_s
        elif fault:
            self.drone.inject_fault(fault, lasts_s)
        else:
            self.acting.append((HOSTILITIES[mishap.kind](self._speaker), now_s + lasts_s))
        return None


def carry_out(case: Case) -> Ended:
    """Raises what the simulated drone raised, when it broke down."""
    rig = HostileRig(case)
    rig.wait_s(case.warm_s)
    rig.stages.begin(rig.now_s())
    try:
        source = open_source("odometry", rig) if case.has_second_source else None
        vehicle = MavlinkVehicle(
            rig.options(), case.safe, is_real=False, clock=rig, source=source, transport=rig, observes=True
        )
    except VehicleError as error:
        rig.stages.over_s = rig.drone.time_s
        return _ended(rig, ReportedOutcome("refused", "unopened", str(error)))
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
    rig.stages.over_s, concern = rig.drone.time_s, vehicle.concern
    left = _leave(rig, vehicle)
    _attend(rig, vehicle)
    trajectory = None if record is None else record.trajectory
    return _ended(rig, ReportedOutcome(outcome, left, reason, concern or vehicle.concern, vehicle.concern, trajectory))


def _attend(rig: HostileRig, vehicle: MavlinkVehicle) -> None:
    """For a while, and for as long as it is armed or in the air, a minute at the most."""
    until_s = rig.now_s() + COMES_DOWN_WITHIN_S
    vehicle.attend(ATTENDED_S)
    while rig.now_s() < until_s and (rig.truth.armed or rig.truth.flies):
        vehicle.attend(ATTENDED_S)


def _leave(rig: HostileRig, vehicle: MavlinkVehicle) -> str:
    """What the program says of the vehicle, after what everybody does on any exit."""
    try:
        held = vehicle.stage(rig.case.safe)
    except SafeGainsError:
        return "quarantined"
    except VehicleError:
        return "safe" if not vehicle.concern else "quarantined"
    return "safe" if held == rig.case.safe else "quarantined"


def _ended(rig: HostileRig, reported: ReportedOutcome) -> Ended:
    first = rig.case.mishaps[0]
    struck = f"{first.kind} from {first.stage} on, for {first.duration_s:g} s"
    return Ended(reported.outcome, reported.vehicle, reported.reason, struck, judge(rig.truth, reported))


def _unwatched(_sample: Sample) -> None:
    pass
