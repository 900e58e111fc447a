"""Recorded trials of the real Paparazzi, heard by the machine through the profile, give the flights that they hold."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.commands import Action, Setting
from app.autopilots.dialects import source_system
from app.autopilots.measurements import Position
from app.autopilots.registry import AUTOPILOTS
from app.core.experiments.takeoff import Takeoff
from app.core.records.trajectory import Trajectory
from app.vehicles.mavlink.events import (
    ActionDone,
    Command,
    Event,
    GainsRestored,
    PacketReceived,
    PerformAction,
    RecordSample,
    RestoreGains,
    Tick,
)
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.trial_machine import advance, begin
from app.vehicles.mavlink.trial_state import State, Trial
from tests.vehicles.mavlink.replaying import FLOWN, GROUND_STATION, LOGS, Recorded, messages, read, recorded

PAPARAZZI = AUTOPILOTS["paparazzi"]
TAKEOFFS = Path(__file__).parents[2] / "data" / "takeoffs"
TAKEOFF = Takeoff()
SAFE_GAINS = tuple(Setting(name, 0.0) for name in ("gui_v_kp", "gui_v_kd", "gui_v_ki"))
PLAN = Plan(
    autopilot=replace(PAPARAZZI, landed_blocks=frozenset()),
    safe_gains=SAFE_GAINS,
    blocks={
        2: "Holding point",
        3: "Start Engine",
        4: "Takeoff",
        13: "land here",
        14: "land",
        15: "flare",
        16: "landed",
    },
    ground_m=0.1,
    set_point_m=3.0,
    min_battery_v=10.5,
)


class Replay:
    """The vehicle's side of a recorded trial, from the block that starts its engine on."""

    def __init__(self, gains: tuple[int, int, int]) -> None:
        arming, _, landing = (each.time_s for each in messages(gains, "SCRIPT_ITEM", from_vehicle=False)[1:])
        [kill] = (each.time_s for each in messages(gains, "PARAM_SET", from_vehicle=False)[3:])
        self.recorded = [each for each in recorded(gains) if each.is_from_vehicle and each.time_s >= arming]
        self.landing_s, self.kill_s = landing, kill
        before = [each for each in messages(gains, "LOCAL_POSITION_NED", from_vehicle=True) if each.time_s < arming]
        positions = [heard for each in before if isinstance(heard := PAPARAZZI.measure(each.message), Position)]
        ground_m = float(np.median([position.altitude_m for position in positions]))
        plan = replace(PLAN, ground_m=ground_m)
        self.told: list[tuple[float, Command]] = []
        self.states = [State.ARM]
        self.trial: Trial
        self.trial, _ = begin(plan, TrialObservation.begin(arming, last=positions[-1], battery_v=12.4), arming)
        self.give(ActionDone(Action.ARM, arming))

    def run(self) -> None:
        """To the end. The recorded ground station waited longer before it stopped the motors: that wait is left out."""
        ahead_s = 0.0
        for each in self.recorded:
            if self.trial.state is State.DISARM and ahead_s == 0.0 and each.time_s < self.kill_s:
                continue
            if self.trial.state is State.DISARM and ahead_s == 0.0:
                ahead_s = each.time_s - self.trial.since_s
            self.hear(replace(each, time_s=each.time_s - ahead_s))
            if self.trial.state is State.RESTORE:
                self.give(GainsRestored(each.time_s - ahead_s))
                return

    def hear(self, each: Recorded) -> None:
        self.give(PacketReceived(PAPARAZZI.measure(each.message), each.time_s))
        self.give(Tick(each.time_s))

    def give(self, event: Event) -> None:
        self.trial, commands = advance(self.trial, event)
        self.told += [(event.now_s, command) for command in commands]
        if self.states[-1] is not self.trial.state:
            self.states.append(self.trial.state)

    def when(self, action: Action) -> float:
        return next(at_s for at_s, command in self.told if command == PerformAction(action))

    @property
    def trajectory(self) -> Trajectory:
        start_s = self.trial.commanded_boot_s
        assert start_s is not None
        kept = [command.position for _, command in self.told if isinstance(command, RecordSample)]
        time_s = np.array([position.time_boot_s - start_s for position in kept])
        return Trajectory(time_s, {"altitude_m": np.array([each.altitude_m for each in kept])}, "mavlink", "vehicle")


@pytest.fixture(scope="module", params=FLOWN, ids=str)
def replay(request: pytest.FixtureRequest) -> tuple[tuple[int, int, int], Replay]:
    flight = Replay(request.param)
    flight.run()
    return request.param, flight


def stored_takeoff(gains: tuple[int, int, int]) -> Trajectory:
    path = TAKEOFFS / f"paparazzi_{'_'.join(map(str, gains))}.csv"
    time_s, altitude_m, _ = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
    return Trajectory(time_s, {"altitude_m": altitude_m}, "csv", "vehicle")


@pytest.mark.complete
def test_a_recorded_trial_goes_through_its_states_without_any_failure(
    replay: tuple[tuple[int, int, int], Replay],
) -> None:
    _, flight = replay
    assert flight.states == [
        State.ARM,
        State.TAKEOFF,
        State.RECORD,
        State.LAND,
        State.DISARM,
        State.RESTORE,
        State.IDLE,
    ]
    assert (flight.trial.failure, flight.trial.watch.positions.glitches) == (None, 0)
    assert RestoreGains() in [command for _, command in flight.told]


def test_a_recorded_trial_scores_as_its_takeoff_does(replay: tuple[tuple[int, int, int], Replay]) -> None:
    gains, flight = replay
    assert TAKEOFF.error(flight.trajectory) == pytest.approx(TAKEOFF.error(stored_takeoff(gains)), rel=0.005)


def test_the_errors_are_those_that_were_published_of_the_recordings(
    replay: tuple[tuple[int, int, int], Replay],
) -> None:
    gains, flight = replay
    published = {(283, 13, 82): 0.3297, (1624, 1356, 195): 0.0987}
    assert TAKEOFF.error(flight.trajectory) == pytest.approx(published[gains], rel=0.005)


def test_land_is_told_when_it_was_and_the_ground_is_recognised_soon(
    replay: tuple[tuple[int, int, int], Replay],
) -> None:
    _, flight = replay
    assert flight.when(Action.LAND) == pytest.approx(flight.landing_s, abs=0.1)
    touched_s = flight.when(Action.MOTORS_OFF) - 2.0
    assert 3.0 < touched_s - flight.landing_s < 8.0
    assert flight.when(Action.MOTORS_OFF) < flight.kill_s - 10.0


def heard(log: str, autopilot: str) -> list[PacketReceived]:
    """What the vehicle sent in a log."""
    profile = AUTOPILOTS[autopilot]
    vehicle = [each for each in read(LOGS / log, profile.dialect) if source_system(each.message) != GROUND_STATION]
    return [PacketReceived(profile.measure(each.message), each.time_s) for each in vehicle]


def follow(plan: Plan, packets: list[PacketReceived], armed_s: float) -> tuple[Trial, list[Action]]:
    """Begin a trial at the last position before `armed_s`, and hear the rest."""
    before = [each.measurement for each in packets if each.now_s < armed_s and isinstance(each.measurement, Position)]
    trial, commands = begin(
        plan, TrialObservation.begin(armed_s, last=before[-1], battery_v=12.4, stood_s=1.0), armed_s
    )
    told = list(commands)
    events: list[Event] = [ActionDone(Action.ARM, armed_s)]
    events += [event for each in packets if each.now_s >= armed_s for event in (each, Tick(each.now_s))]
    for event in events:
        trial, commands = advance(trial, event)
        told += commands
        if RestoreGains() in commands:
            trial, _ = advance(trial, GainsRestored(event.now_s))
    return trial, [command.action for command in told if isinstance(command, PerformAction)]


def test_a_recorded_fall_whose_altitude_steps_is_a_fall_and_not_the_gains() -> None:
    """Another station stopped the motors at 3.3 m: 8 steps of its altitude, up to 0.65 m, and -6.5 m/s at the ground.
    It was aborted for its climb rate of -4.1 m/s, and ready."""
    packets = heard("paparazzi_motors_stopped_in_the_air.tlog.gz", "paparazzi")
    trial, actions = follow(replace(PLAN, autopilot=PAPARAZZI), packets, 1.5)
    assert (trial.state, trial.failure, trial.contact) == (State.QUARANTINE, Failure.UNEXPECTED, "fell")
    assert not {Action.MOTORS_OFF, Action.KILL} & set(actions)


def test_a_recorded_drift_on_the_ground_after_arming_is_no_takeoff_and_no_quarantine() -> None:
    """0.45 m in 3.6 s, while its landed state was on the ground: its motors were not stopped, because it was taken to
    be in the air."""
    packets = heard("px4_ground_drift_after_arming.tlog.gz", "px4")
    plan = replace(PLAN, autopilot=AUTOPILOTS["px4"], ground_m=0.2, blocks={})
    trial, actions = follow(plan, [each for each in packets if each.now_s < 5.0], 1.1)
    assert (trial.state, trial.failure) == (State.DISARM, Failure.LOST_POSITION)
    assert (actions[0], set(actions[1:])) == (Action.ARM, {Action.MOTORS_OFF})
