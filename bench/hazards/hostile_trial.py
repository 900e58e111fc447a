"""Whole trials over a hostile link, or with a fault of the vehicle: every hazard in every state of a trial, under every
autopilot. `hostile_checks.py` has the checks."""

import random
import threading
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Final

from app.autopilots.simulated.copter import Copter
from app.simdrone.drone import BOOT_S
from app.vehicles.base import FlightOptions, FlightRecord, Identity, SafeGainsError, Sample, VehicleError
from app.vehicles.mavlink.transports import Peer
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mavlink_kind import open_source
from bench.hazards.cases import ABORT, FOR_GOOD_S, SAFE, Case, PlannedFault, tuned_gains
from bench.hazards.fault_trial import outcome_of
from bench.hazards.hostile_checks import LOST, GroundTruth, ReportedOutcome, TrueState, find_violations
from bench.hazards.hostile_links import POSITION, LinkHazard, MessageForger
from bench.hazards.hostile_table import HAZARDS, PILOTS, PROCESS_KILLED
from bench.hazards.rig import InjectedFault, Rig
from bench.hazards.trial_states import State
from bench.hazards.wire import DIALECTS

SHORT_S: Final = 1.5
POWERED_S: Final = 15.0
"""Time from switching on to the connection, in which Paparazzi reaches "Holding point"."""
COMES_DOWN_WITHIN_S: Final = 60.0
"""Time to land after the trial, while the program attends to the vehicle."""
ATTENDED_S: Final = 5.0
HEARD_S: Final = 1.0
KILLED_FOR_S: Final = 3.0
"""Time from the death of the process until another one has connected."""
OTHER_PORT: Final[Peer] = ("lockstep", 1)
_STATE_TICKS: Final = 4
_HOLDING_POINT: Final = 2
_GEO_INIT_LASTED_S: Final = 1.0
_AIR: Final = (State.TAKEOFF, State.RECORD, State.LAND)


@dataclass(frozen=True, slots=True)
class HostileResult:
    """Result of a case; `failure` is its number in docs/real-flight.md, `wrong` lists the violations."""

    outcome: str
    vehicle: str
    reason: str
    injected: str
    wrong: tuple[str, ...]
    failure: str = ""


def cases(first: int = 0) -> list[Case]:
    """Return all cases: permanent hazards in every state, short ones in the air; seeds start from `first`."""
    drawn = [
        (autopilot, name, state, duration_s)
        for autopilot, (name, hazard) in product(SAFE, HAZARDS.items())
        if autopilot in hazard.autopilots
        for states, duration_s in ((State, FOR_GOOD_S), (() if hazard.has_one_length else _AIR, SHORT_S))
        for state in states
        if state in hazard.states
    ]
    return [_case(first + seed, *what) for seed, what in enumerate(drawn)]


def _case(seed: int, autopilot: str, name: str, state: State, duration_s: float) -> Case:
    chance = random.Random(seed)
    hostile = PlannedFault(name, state, chance.uniform(0.0, 0.8), duration_s)
    causes: dict[State, PlannedFault] = {
        State.ABORT_LAND: PlannedFault(ABORT, State.RECORD, chance.uniform(0.3, 6.0)),
        State.LINK_LOST: PlannedFault("link-lost", State.RECORD, chance.uniform(0.3, 6.0), 5.0),
    }
    return Case(
        seed=seed,
        autopilot=autopilot,
        faults=(hostile, *([causes[state]] if state in causes else [])),
        gains=tuned_gains(chance, autopilot),
        powered_s=POWERED_S,
        staged_s=0.0,
        pinned=chance.random() < 0.5,
    )


class HostileRig(Rig):
    """Rig with a hostile link; `true_states` begin when the drone is switched on."""

    def __init__(self, case: Case) -> None:
        self.acting: list[tuple[LinkHazard, float]] = []
        self.true_states: list[TrueState] = []
        self._received_s = 0.0
        self._pilot_seen_s: list[float] = []
        self._overruled_s = FOR_GOOD_S
        self._ticks = 0
        self._delay_s, self._delayed_until_s = 0.0, 0.0
        self._under_way: list[tuple[float, bytes]] = []
        self._copies_next_position = False
        self._ends_geo_init_s = FOR_GOOD_S
        self.identity: Identity | None = None
        self.is_flying = False
        """What the program has stored: which vehicle it connected, and that it flies."""
        self.process: threading.Thread | None = None
        """Stands for the process of a vehicle that may be killed."""
        self.is_process_dead = False
        self.is_over = threading.Event()
        """The process has ended its work, or is dead."""
        super().__init__(case)
        self._forger = MessageForger(case.autopilot, DIALECTS[case.autopilot], self.drone, random.Random(case.seed))
        hazard = HAZARDS[case.faults[0].kind]
        if hazard.is_always and hazard.link is not None:
            self.acting.append((hazard.link(self._forger), FOR_GOOD_S))

    def write(self, data: bytes) -> bool:
        """Deliver data in the order in which it was sent, delayed or at once."""
        delay_s = self._delay_s if self.drone.time_s < self._delayed_until_s else 0.0
        self._under_way.append((self.drone.time_s + delay_s, data))
        self._deliver()
        return True

    def _deliver(self) -> None:
        while self._under_way and self._under_way[0][0] <= self.drone.time_s:
            super().write(self._under_way.pop(0)[1])

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        now_s = self.drone.time_s
        for hostility, until_s in self.acting:
            if now_s < until_s:
                frames = hostility.transform(frames, now_s)
        self._received_s = now_s if frames else self._received_s
        if self._copies_next_position:
            self._copy_position(frames)
        self._watch_pilot(frames, now_s)
        return frames

    def _copy_position(self, frames: list[bytes]) -> None:
        read = ((frame, self._forger.read(frame)) for frame in frames)
        for frame in (frame for frame, message in read if message is not None and message.get_type() == POSITION):
            self.deliver(frame, OTHER_PORT)
            self._copies_next_position = False

    def _watch_pilot(self, frames: list[bytes], now_s: float) -> None:
        """Record when heartbeats show a pilot after the takeoff, and when the vehicle is taken from that pilot."""
        flown = any(each.kind in PILOTS and each.begun_s < now_s < each.ended_s for each in self.injected)
        if not flown or self.states.first_s(State.TAKEOFF) is None:
            return
        if self.drone.autopilot.is_by_hand:
            read = (self._forger.read(frame) for frame in frames)
            beats = any(message is not None and message.get_type() == "HEARTBEAT" for message in read)
            self._pilot_seen_s += [now_s] if beats else []
        elif self._pilot_seen_s:
            self._overruled_s = min(self._overruled_s, now_s)

    def tick(self) -> None:
        super().tick()
        if self.is_process_dead and threading.current_thread() is self.process:
            self.is_over.set()
            threading.Event().wait()
        self._deliver()
        if self.drone.time_s >= self._ends_geo_init_s:
            self._ends_geo_init_s = FOR_GOOD_S
            self._interfere(("SCRIPT_ITEM", {"target_component": 0, "seq": _HOLDING_POINT, "name": ""}))
        self._ticks += 1
        if self._ticks % _STATE_TICKS == 0:
            now_s, body = self.drone.time_s, self.drone.body
            is_heard = now_s - self._received_s < HEARD_S
            armed = self.drone.autopilot.armed
            self.true_states.append(TrueState(now_s, body.altitude_m, body.climb_rate_m_s, armed, is_heard))

    @property
    def truth(self) -> GroundTruth:
        """Ground truth up to now."""
        return GroundTruth(
            case=self.case,
            states=self.states,
            injected=self.injected,
            sent=self.sent,
            stops=self.stops,
            true_states=self.true_states,
            pilot_seen_s=self._pilot_seen_s,
            overruled_s=self._overruled_s,
            armed=self.drone.autopilot.armed,
            holds_safe=self.holds(self.case.safe),
            rose_m=self.rose_m,
            impact_m_s=self.impact_m_s,
        )

    def _inject(self, planned: PlannedFault, now_s: float) -> None:
        state, hazard = self.states.now, HAZARDS.get(planned.kind)
        if state is None or hazard is None:
            return super()._inject(planned, now_s)
        lasts_s = min(planned.duration_s, hazard.longest_s)
        self.injected.append(InjectedFault(planned.kind, state, now_s, now_s + lasts_s))
        for fault in hazard.faults:
            self.drone.inject_fault(fault, lasts_s)
        if hazard.late_s:
            self._delay_s, self._delayed_until_s = hazard.late_s, now_s + lasts_s
        if hazard.link is not None and not hazard.is_always:
            self.acting.append((hazard.link(self._forger), now_s + lasts_s))
        if hazard.act is not None:
            hazard.act(self)
        return None

    # ---- what a hazard can do that changes neither the packets nor the vehicle

    def kill_process(self) -> None:
        self.is_process_dead = True

    def copy_from_other_port(self) -> None:
        self._copies_next_position = True

    def move_to_other_port(self) -> None:
        self.peer = OTHER_PORT

    def end_geo_init_early(self) -> None:
        """Restart the vehicle; another station enters the next block before "Geo init" has set the reference."""
        self.drone.reboot()
        self._ends_geo_init_s = self.drone.time_s + BOOT_S + _GEO_INIT_LASTED_S

    def enter_offboard(self) -> None:
        autopilot = self.drone.autopilot
        if isinstance(autopilot, Copter):
            autopilot.mode = autopilot.find_mode("OFFBOARD")


def run_trial(case: Case) -> HostileResult:
    """Run the trial of a case. An exception in the simulated drone propagates."""
    rig = HostileRig(case)
    rig.wait_s(case.powered_s)
    rig.states.begin(rig.now_s())
    if case.faults[0].kind != PROCESS_KILLED:
        return _run(rig)
    ended = _until_death(rig, lambda: _run(rig))
    return ended if ended is not None else _go_on_after_death(rig)


def _run(rig: HostileRig) -> HostileResult:
    try:
        vehicle = _connect(rig)
    except VehicleError as error:
        rig.states.ended_s = rig.drone.time_s
        return _result(rig, ReportedOutcome("refused", "unopened", str(error)))
    try:
        return _stage_and_fly(rig, vehicle)
    finally:
        vehicle.close()


def _connect(rig: HostileRig) -> MavlinkVehicle:
    """Connect as a process does, which knows what the program has stored, and hears nothing that was sent before."""
    rig.close()
    source = open_source("odometry", rig) if rig.case.has_second_source else None
    return MavlinkVehicle(
        rig.options(),
        rig.case.safe,
        is_real=False,
        clock=rig,
        identity=rig.identity,
        source=source,
        transport=rig,
        observes=True,
        was_flying=rig.is_flying,
    )


def _until_death(rig: HostileRig, work: Callable[[], HostileResult]) -> HostileResult | None:
    """Return the result of the program's work, which runs in a thread that stands still for ever once the process is
    killed, without closing or ending anything; None if it was killed."""
    ended: list[HostileResult] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            ended.append(work())
        except BaseException as error:  # noqa: BLE001 - raised again by the caller
            errors.append(error)
        rig.is_over.set()

    rig.process = threading.Thread(target=run, daemon=True)
    rig.process.start()
    rig.is_over.wait()
    for error in errors:
        raise error
    return ended[0] if ended else None


def _go_on_after_death(rig: HostileRig) -> HostileResult:
    """Reconnect as another process does, attend to the vehicle, and return what it reports."""
    rig.states.ended_s = rig.drone.time_s
    rig.wait_s(KILLED_FOR_S)
    try:
        vehicle = _connect(rig)
    except VehicleError as error:
        return _result(rig, ReportedOutcome(LOST, "unopened", str(error)))
    _attend(rig, vehicle)
    concern = vehicle.concern
    left = _restore_safe_gains(rig, vehicle)
    return _result(rig, ReportedOutcome(LOST, left, concern, concern, vehicle.concern))


def _stage_and_fly(rig: HostileRig, vehicle: MavlinkVehicle) -> HostileResult:
    record: FlightRecord | None = None
    outcome, failure = "refused", ""
    try:
        held = vehicle.stage(rig.case.gains)
        if held != rig.case.gains:
            raise VehicleError(f"it holds {held}", hint="")
        rig.identity, rig.is_flying = vehicle.identity, True
        order = FlightOptions(seed=1, window_s=rig.case.window_s)
        record = vehicle.fly(order, on_sample=_ignore_sample, should_stop=lambda: rig.stop_request)
        outcome, reason, failure = outcome_of(record), record.reason, record.end.failure or ""
    except VehicleError as error:
        reason = str(error)
    rig.states.ended_s, concern = rig.drone.time_s, vehicle.concern
    left = _restore_safe_gains(rig, vehicle)
    _attend(rig, vehicle)
    trajectory = None if record is None else record.trajectory
    reported = ReportedOutcome(outcome, left, reason, concern or vehicle.concern, vehicle.concern, trajectory, failure)
    return _result(rig, reported)


def _attend(rig: HostileRig, vehicle: MavlinkVehicle) -> None:
    """Attend to the vehicle for a while, and while it is armed or in the air, for a minute at most."""
    until_s = rig.now_s() + COMES_DOWN_WITHIN_S
    vehicle.attend(ATTENDED_S)
    while rig.now_s() < until_s and (rig.truth.armed or rig.truth.flies):
        vehicle.attend(ATTENDED_S)


def _restore_safe_gains(rig: HostileRig, vehicle: MavlinkVehicle) -> str:
    """Stage the safe gains, as on every exit, and return the reported state of the vehicle."""
    try:
        held = vehicle.stage(rig.case.safe)
    except SafeGainsError:
        return "quarantined"
    except VehicleError:
        return "safe" if not vehicle.concern else "quarantined"
    return "safe" if held == rig.case.safe else "quarantined"


def _result(rig: HostileRig, reported: ReportedOutcome) -> HostileResult:
    first = rig.case.faults[0]
    injected = f"{first.kind} from {first.state}, for {first.duration_s:g} s"
    wrong = find_violations(rig.truth, reported)
    return HostileResult(reported.outcome, reported.vehicle, reported.reason, injected, wrong, reported.failure)


def _ignore_sample(_sample: Sample) -> None:
    pass
