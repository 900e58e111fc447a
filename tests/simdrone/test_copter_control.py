"""The simulated copters fly by the replicas of their vertical loops, and to position targets."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from app.autopilots.ardupilot.replica import vertical as ardupilot
from app.autopilots.ardupilot.simulated_control import ArduPilotController
from app.autopilots.px4.replica import vertical as px4
from app.autopilots.px4.simulated_control import Px4Controller
from app.autopilots.simulated.copter import Copter
from tests.simdrone.copters import (
    ARM,
    ARMED,
    GUIDED,
    INT32,
    POSITION,
    POSITION_ONLY,
    SET_INTERVAL,
    SET_MODE,
    TAKE_OFF,
    ArduPilot,
    Px4,
    bytewise,
)
from tests.simdrone.ground import Ground, Heard, LockstepWire, flying

CONTROLLER_OUTPUT, ATTITUDE_TARGET, POSITION_TARGET = 62, 83, 85
OFFBOARD, LANDING = 6 << 16, 4 << 16 | 6 << 24
EVERY_20_MS = 20_000.0
PUSHED = 0b110011111000


@dataclass
class Run:
    """What the loop got and gave in each tick, and the messages of that tick."""

    inputs: list[NDArray[np.floating]] = field(default_factory=list)
    outputs: list[NDArray[np.floating]] = field(default_factory=list)
    messages: list[list[Heard]] = field(default_factory=list)

    def of(self, kind: str) -> list[tuple[int, Heard]]:
        return [
            (tick, message)
            for tick, messages in enumerate(self.messages)
            for message in messages
            if message.get_type() == kind
        ]


def copter_of(ground: Ground) -> Copter:
    assert isinstance(ground.wire, LockstepWire)
    copter = ground.wire.lockstep.drone.autopilot
    assert isinstance(copter, Copter)
    return copter


def record(ground: Ground, ticks: int, run: Run) -> None:
    controller = copter_of(ground).controller
    assert isinstance(controller, ArduPilotController | Px4Controller)
    for _ in range(ticks):
        parsed = [ground.mav.parse_buffer(data) or [] for data in ground.wire.receive()]
        run.messages.append([message for messages in parsed for message in messages])
        run.inputs.append(controller.inputs[0].copy())
        run.outputs.append(controller.outputs[0].copy())


def seconds(count: float) -> int:
    return round(256 * count)


def steps_of_one_metre(**gains: float) -> Run:
    """A metre up and down again, 6 s each, after a takeoff to 3 m and a target there."""
    ground = flying("ardupilot")
    pilot = ArduPilot(ground)
    for name, gain in gains.items():
        pilot.set(name, gain)
    pilot.hover()
    ground.listen(3.0)
    for message in (POSITION, CONTROLLER_OUTPUT, ATTITUDE_TARGET, POSITION_TARGET):
        assert pilot.command(SET_INTERVAL, message, EVERY_20_MS) == 0
    run = Run()
    pilot.go_to(3.0)
    record(ground, seconds(1.0), run)
    for height_m in (4.0, 3.0):
        pilot.go_to(height_m)
        record(ground, seconds(6.0), run)
    return run


@pytest.fixture(scope="module")
def run() -> Run:
    """With default gains."""
    return steps_of_one_metre()


@pytest.mark.complete
def test_arducopter_flies_position_targets_on_a_shaped_trajectory_and_reports_the_error_to_it(run: Run) -> None:
    inputs, outputs = np.array(run.inputs), np.array(run.outputs)
    target_m, z_m, z_d_m = inputs[:, 0], inputs[:, 1], outputs[:, 0]
    up = slice(seconds(1.0), seconds(7.0))
    assert set(target_m[up][1:]) == {4.0}
    assert z_d_m[up][0] == pytest.approx(3.0, abs=0.01)
    assert np.abs(outputs[:, 1]).max() == pytest.approx(0.76, abs=0.02), "the shaper's, for 1 m/s² and 5 m/s³"
    assert z_d_m[up][-1] == pytest.approx(4.0, abs=0.001)
    assert z_m[up][-1] == pytest.approx(4.0, abs=0.01)
    for tick, message in run.of("NAV_CONTROLLER_OUTPUT"):
        assert message.alt_error == pytest.approx(z_d_m[tick] - z_m[tick], abs=1e-6)
    for tick, message in run.of("ATTITUDE_TARGET"):
        assert message.thrust == pytest.approx(outputs[tick, ardupilot.THROTTLE], abs=1e-6)
    assert {(message.z, message.type_mask) for _, message in run.of("POSITION_TARGET_LOCAL_NED")[60:]} == {
        (-4.0, POSITION_ONLY),
        (-3.0, POSITION_ONLY),
    }


@pytest.mark.complete
def test_arducopters_gains_decide_how_closely_it_follows(run: Run) -> None:
    tuned = steps_of_one_metre(PSC_POSZ_P=2.0, PSC_VELZ_P=7.0, PSC_ACCZ_P=1.0, PSC_ACCZ_I=2.0)
    errors_m = [
        np.mean([abs(message.alt_error) for _, message in each.of("NAV_CONTROLLER_OUTPUT")]) for each in (run, tuned)
    ]
    assert errors_m[1] < 0.5 * errors_m[0]


@pytest.mark.complete
def test_arducopter_ignores_other_targets_and_those_in_other_modes() -> None:
    pilot = ArduPilot(flying("ardupilot"))
    pilot.hover()
    pilot.ground.listen(3.0)
    pilot.go_to(5.0, mask=0)
    pilot.ground.listen(2.0)
    assert pilot.height_m() == pytest.approx(3.0, abs=0.05)
    assert pilot.command(SET_MODE, 1, 17) == 0
    pilot.go_to(5.0)
    pilot.ground.listen(2.0)
    assert pilot.height_m() == pytest.approx(3.0, abs=0.05)


def test_arducopters_takeoff_is_the_replicas() -> None:
    pilot = ArduPilot(flying("ardupilot"))
    assert pilot.command(SET_MODE, 1, GUIDED) == 0
    pilot.arm()
    controller = copter_of(pilot.ground).controller
    assert isinstance(controller, ArduPilotController)
    pilot.tell(TAKE_OFF, 0, 0, 0, 0, 0, 0, 3.0)
    state, packed, run = controller._state.copy(), controller._packed.copy(), Run()
    record(pilot.ground, seconds(8.0), run)
    inputs = np.array(run.inputs)
    computed = np.empty((len(inputs), len(ardupilot.OUTPUTS)))
    ardupilot.rollout(state, packed, inputs, computed, np.zeros(len(inputs), dtype=np.bool_), computed)
    assert inputs[-1, ardupilot.INPUTS.index("z_m")] > 2.8
    assert np.array_equal(computed, np.array(run.outputs))


@pytest.fixture
def px4_pilot() -> Px4:
    """In hold at 3 m, with its landing as the reaction to a lost stream."""
    pilot = Px4(flying("px4"))
    pilot.set("COM_OBL_RC_ACT", bytewise(4), INT32)
    pilot.hover()
    pilot.ground.listen(5.0)
    return pilot


def stream(pilot: Px4, count: int, height_m: float, mask: int = POSITION_ONLY, afz: float = 0.0) -> None:
    """A set point every 0.1 s, in the local frame."""
    for _ in range(count):
        pilot.go_to(height_m + 0.51, mask, afz=afz)
        pilot.ground.listen(0.1)


@pytest.mark.complete
def test_px4_enters_offboard_only_if_it_is_streamed_to_follows_and_lands_when_the_stream_ends(px4_pilot: Px4) -> None:
    pilot, ground = px4_pilot, px4_pilot.ground
    assert pilot.command(SET_INTERVAL, CONTROLLER_OUTPUT, EVERY_20_MS) == 4
    assert pilot.command(SET_MODE, 1, 6) == 1
    stream(pilot, 5, 3.0)
    assert pilot.command(SET_MODE, 1, 6) == 1
    assert pilot.words() == ["Switching to Offboard is currently not available"] * 2
    stream(pilot, 8, 3.0)
    for message in (ATTITUDE_TARGET, POSITION_TARGET):
        assert pilot.command(SET_INTERVAL, message, EVERY_20_MS) == 0
    assert pilot.command(SET_MODE, 1, 6) == 0
    stream(pilot, 60, 4.0)
    assert pilot.height_m() == pytest.approx(4.0, abs=0.03)
    assert ground.expect("HEARTBEAT").custom_mode == OFFBOARD
    assert ground.expect("POSITION_TARGET_LOCAL_NED").z == pytest.approx(-4.51)
    assert ground.expect("ATTITUDE_TARGET").thrust == pytest.approx(0.61, abs=0.02)
    ground.expect("HEARTBEAT", lambda message: message.custom_mode == LANDING, within_s=2.0)
    ground.expect("HEARTBEAT", lambda message: not message.base_mode & ARMED, within_s=15.0)
    assert "No offboard signal" in pilot.words()


@pytest.mark.complete
def test_px4_adds_a_streamed_acceleration_as_a_push_that_it_holds_against(px4_pilot: Px4) -> None:
    """In the end the integral takes up the push of 1 m/s² downwards."""
    stream(px4_pilot, 12, 3.0)
    assert px4_pilot.command(SET_MODE, 1, 6) == 0
    stream(px4_pilot, 8, 3.0, mask=PUSHED, afz=1.0)
    assert px4_pilot.height_m() < 2.95
    stream(px4_pilot, 60, 3.0, mask=PUSHED, afz=1.0)
    assert px4_pilot.height_m() == pytest.approx(3.0, abs=0.03)


@pytest.mark.complete
def test_px4s_takeoff_and_steps_are_the_replicas() -> None:
    pilot = Px4(flying("px4"))
    pilot.ground.listen(3.5)
    controller, run = copter_of(pilot.ground).controller, Run()
    assert isinstance(controller, Px4Controller)
    pilot.tell(ARM, 1.0)
    pilot.tell(TAKE_OFF, 0, 0, 0, 0, 0, 0, float("nan"))
    for height_m in (*[3.0] * 120, *[4.0] * 20):
        pilot.go_to(height_m + 0.51)
        record(pilot.ground, seconds(0.125), run)
        if len(run.inputs) == seconds(12.5):
            pilot.tell(SET_MODE, 1, 6)
    rows = slice(1 - controller._tick % 2, None, 2)
    inputs, outputs = np.array(run.inputs)[rows], np.array(run.outputs)[rows]
    assert -inputs[-1, px4.INPUTS.index("z_m")] > 3.9
    state, computed = np.empty(px4.STATE_SIZE, dtype=np.float32), np.empty_like(outputs)
    px4.start(state, controller._packed)
    px4.rollout(state, controller._packed, inputs, computed)
    assert np.array_equal(computed, outputs, equal_nan=True)
