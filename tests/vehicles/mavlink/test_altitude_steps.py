"""Whole trials of altitude steps against the simulated autopilots, in lockstep."""

from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.dialects import number
from app.autopilots.registry import get_experiment
from app.autopilots.simulated.copter_parameters import Parameters
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.models.set_points import SetPoints
from app.vehicles.base import FlightOptions, FlightRecord, OptionValue, VehicleError
from app.vehicles.flight_end import Failure, Landing, StopRequest
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.registry import open_vehicle
from tests.core.tuning.flying import compiled_only
from tests.vehicles.flying import SAFE, TUNED, Watcher, never, unwatched
from tests.vehicles.mavlink.rigs import SAFE as OWN_SAFE
from tests.vehicles.mavlink.rigs import LockstepRig, copter_of

STEPS = AltitudeSteps().configured({"steps": 2, "step_window_s": 3.0})
"""At 10 s from 3 m to 2 m, at 13 s back; scored until 16 s."""
ORDER = FlightOptions(seed=1, window_s=STEPS.window_s, set_points=STEPS.set_points)
TOLERANCE_M = 0.001
"""The steps are up to 10 ms early or late, and the link sends positions 51 times a second, rounded to 1/256 m."""


def fly(rig: LockstepRig, order: FlightOptions = ORDER, watcher: Watcher | None = None) -> FlightRecord:
    vehicle = rig.vehicle()
    vehicle.stage(TUNED)
    watch, decide = (unwatched, never) if watcher is None else (watcher.see, watcher.decide)
    record = vehicle.fly(order, on_sample=watch, should_stop=decide)
    assert vehicle.read_gains() == SAFE
    assert rig.drone.body.stands
    vehicle.close()
    return record


def error_without_a_link() -> float:
    with open_vehicle("twin", {"scatter": 0.0}, safe_gains=SAFE) as twin:
        twin.stage(TUNED)
        return STEPS.error(twin.fly(ORDER, on_sample=unwatched, should_stop=never).trajectory)


def waypoints(rig: LockstepRig) -> list[float]:
    return [number(message, "z") for message in rig.told("MISSION_ITEM")]


@pytest.mark.complete
@compiled_only
def test_the_steps_score_as_the_same_body_does_without_a_link() -> None:
    watcher = Watcher()
    with LockstepRig() as rig:
        record = fly(rig, watcher=watcher)
        assert waypoints(rig) == [3.0, 2.0, 3.0]
    flight = record.trajectory
    assert (record.ending, record.reason) == ("completed", "")
    assert STEPS.error(flight) == pytest.approx(error_without_a_link(), abs=TOLERANCE_M)
    changes_s = flight.time_s[1:][np.diff(flight["set_point_m"]) != 0.0]
    assert changes_s == pytest.approx([0.0, 10.0, 13.0], abs=0.03)
    assert flight["set_point_m"][-1] == 3.0
    live_s, live_m = np.array([(sample.time_s, sample["reference_m"]) for sample in watcher.samples]).T
    assert np.interp(live_s, flight.time_s, flight["reference_m"]) == pytest.approx(live_m, abs=1e-9)


@compiled_only
@pytest.mark.complete
@pytest.mark.parametrize("lost", ["deaf:0.1@9.95", "ack-lost:0.1@9.95"])
def test_a_set_point_that_was_repeated_took_effect_when_the_vehicle_began_to_move(lost: str) -> None:
    with LockstepRig(faults=[lost]) as rig:
        record = fly(rig)
        assert waypoints(rig) == [3.0, 2.0, 2.0, 3.0]
    late_s = 0.5 if lost.startswith("deaf") else 0.0
    flight = record.trajectory
    changes_s = flight.time_s[1:][np.diff(flight["set_point_m"]) != 0.0]
    assert changes_s == pytest.approx([0.0, 10.0 + late_s, 13.0], abs=0.03)
    assert record.ending == "completed"
    assert STEPS.error(flight) == pytest.approx(error_without_a_link(), abs=3 * TOLERANCE_M)


@pytest.mark.complete
@compiled_only
def test_a_set_point_that_is_never_confirmed_ends_the_flight_as_invalid() -> None:
    with LockstepRig(faults=["ack-lost:5@12"]) as rig:
        record = fly(rig)
        assert waypoints(rig) == [3.0, 2.0, 3.0, 3.0, 3.0]
    assert record.ending == "invalid"
    assert record.end.failure is Failure.SET_POINT
    assert "reference_m" not in record.trajectory.channels
    assert record.trajectory["set_point_m"][-1] == pytest.approx(0.1, abs=0.01)


@compiled_only
@pytest.mark.complete
def test_an_abort_while_a_set_point_is_under_way_lands_on_the_safe_gains_and_does_not_repeat_it() -> None:
    """The first step would be repeated at 10.5 s, because its acknowledgement is lost."""
    with LockstepRig(faults=["ack-lost:0.1@9.95"]) as rig:
        record = fly(rig, watcher=Watcher(abort_at_s=10.3))
        assert waypoints(rig) == [3.0, 2.0]
    assert (record.ending, record.reason) == ("aborted", "the operator pressed Abort")


@pytest.mark.complete
@compiled_only
def test_motors_off_during_a_step_stops_it_at_once() -> None:
    def decide() -> StopRequest | None:
        return StopRequest("it burns", motors_off=True) if watcher.samples[-1].time_s > 10.3 else None

    watcher = Watcher()
    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        vehicle.stage(TUNED)
        stop = lambda: decide() if watcher.samples else None  # noqa: E731
        record = vehicle.fly(ORDER, on_sample=watcher.see, should_stop=stop)
        assert waypoints(rig) == [3.0, 2.0]
    assert (record.ending, record.end.landed) == ("aborted", Landing.FELL)
    assert (record.end.failure, record.end.request) == (Failure.OPERATOR, StopRequest("it burns", motors_off=True))


@pytest.mark.complete
def test_set_points_too_near_the_altitude_limit_or_the_ground_are_refused_on_the_ground() -> None:
    for low_m, high_m in ((3.0, 3.6), (3.0, 1.5)):
        order = replace(ORDER, set_points=SetPoints((0.0, 10.0), (low_m, high_m)))
        with LockstepRig() as rig:
            vehicle = rig.vehicle()
            vehicle.stage(TUNED)
            with pytest.raises(
                VehicleError, match=r"required: above 1.5 m, half of the first, and at most 3.5 m"
            ) as why:
                vehicle.fly(order, on_sample=unwatched, should_stop=never)
            assert why.value.not_flown
            assert waypoints(rig) == []


@compiled_only
@pytest.mark.complete
def test_the_next_takeoff_climbs_to_its_own_height() -> None:
    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        for height_m in (3.4, 3.0):
            steps = STEPS.configured({"steps": 2, "step_window_s": 3.0, "height_m": height_m, "step_m": 0.25})
            vehicle.stage(TUNED)
            order = FlightOptions(seed=1, window_s=steps.window_s, set_points=steps.set_points)
            record = vehicle.fly(order, on_sample=unwatched, should_stop=never)
            assert record.trajectory["altitude_m"][-1] == pytest.approx(height_m, abs=0.05)


SHORT: dict[str, OptionValue] = {"steps": 2, "step_window_s": 3.0}
TARGET = "SET_POSITION_TARGET_LOCAL_NED"
ERRORS_M = {"ardupilot": (0.03, 0.08), "ardupilot-4.7": (0.03, 0.08), "px4": (0.2, 0.4)}
"""Around those of longer steps: 49 mm and 229 mm."""


def copter(release: str) -> LockstepRig:
    rig = LockstepRig(release.partition("-")[0], release=release)
    rig.switch_on_failsafes()
    return rig


def order_of(autopilot: str, **more: OptionValue) -> FlightOptions:
    steps = get_experiment(f"altitude-steps-{autopilot}", SHORT | more)
    assert steps.set_points is not None
    return FlightOptions(seed=1, window_s=steps.window_s, set_points=steps.set_points)


def require_armable_again(vehicle: MavlinkVehicle) -> None:
    """It returned to Offboard when it disarmed, where the real one refused every later flight."""
    vehicle.attend(1.5)
    assert vehicle.condition().mode == "Offboard"
    assert [item.name for item in vehicle.check() if not item.passed] == []
    assert vehicle.condition().mode == "Hold"


def require_hover_throttle(rig: LockstepRig, vehicle: MavlinkVehicle, order: FlightOptions) -> None:
    """It hovered at 0.62, where PX4's estimate must reach before it flies again."""
    assert vehicle._hover_throttle == pytest.approx(0.62, abs=0.02)
    parameters = copter_of(rig.drone).parameters
    held = parameters["HTE_THR_RANGE"]
    parameters["HTE_THR_RANGE"] = 0.05
    vehicle.stage(OWN_SAFE["px4"])
    said = r"Hover throttle: 0\.6\d in the last flight, required: within MPC_THR_HOVER ± HTE_THR_RANGE, 0\.45 … 0\.55"
    with pytest.raises(VehicleError, match=said) as refused:
        vehicle.fly(order, on_sample=unwatched, should_stop=never)
    assert refused.value.not_flown
    assert "Set MPC_THR_HOVER to 0.6" in refused.value.hint
    parameters["HTE_THR_RANGE"] = held


@compiled_only
@pytest.mark.parametrize(
    "release", [*(pytest.param(each, marks=pytest.mark.complete) for each in ("ardupilot", "ardupilot-4.7")), "px4"]
)
def test_the_copters_hold_by_a_position_target_then_step_and_report_their_reference(release: str) -> None:
    with copter(release) as rig:
        name, order = rig.autopilot, order_of(rig.autopilot)
        learns = rig.drone.autopilot.parameters["MOT_HOVER_LEARN"] if name == "ardupilot" else None
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE[name])
        record = vehicle.fly(order, on_sample=unwatched, should_stop=never)
        assert (record.ending, record.reason) == ("completed", "")
        assert rig.drone.body.stands
        if name == "ardupilot":
            assert rig.drone.autopilot.parameters["MOT_HOVER_LEARN"] == learns == 2.0
        targets = [(at_s, -number(message, "z")) for at_s, message in rig.heard if message.get_type() == TARGET]
        commanded_s = next(at_s for at_s, message in reversed(rig.heard) if message.get_type() == "COMMAND_LONG")
        if name == "px4":
            require_armable_again(vehicle)
            require_hover_throttle(rig, vehicle, order)
        vehicle.close()
    flight = record.trajectory
    low, high = ERRORS_M[release]
    assert low < get_experiment(f"altitude-steps-{name}", SHORT).error(flight) < high
    ground_m = 0.51 if name == "px4" else 0.0
    altitudes_m = np.array([altitude_m for _, altitude_m in targets]) - ground_m
    assert altitudes_m[np.diff(altitudes_m, prepend=0.0) != 0.0] == pytest.approx([3.0, 2.0, 3.0], abs=0.02)
    if name == "px4":
        assert np.diff([at_s for at_s, _ in targets]).max() < 0.1
        assert targets[-1][0] < commanded_s
    else:
        assert np.diff([at_s for at_s, _ in targets]) == pytest.approx([6.0, 3.0], abs=0.05)
    changes_s = flight.time_s[1:][np.diff(flight["set_point_m"]) != 0.0]
    assert changes_s == pytest.approx([0.0, 15.0, 18.0], abs=0.05)
    own = {"ardupilot": "MOT_THST_HOVER", "px4": "MPC_THR_HOVER"}[name]
    assert record.settings[own] == pytest.approx(rig.drone.autopilot.parameters[own])
    percents = np.round(flight["throttle"] * 100.0) / 100.0
    assert np.abs(flight["throttle"] - percents).max() > 0.003, "it is not VFR_HUD's"


@compiled_only
@pytest.mark.complete
def test_a_px4_that_refuses_to_follow_set_points_at_first_is_asked_again() -> None:
    """It does, until they have arrived for a second."""
    with LockstepRig("px4", faults=["deaf:0.7@9.4"]) as rig:
        rig.switch_on_failsafes()
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE["px4"])
        record = vehicle.fly(order_of("px4"), on_sample=unwatched, should_stop=never)
        assert "Offboard is currently not available" in " ".join(vehicle._radio.seen.status_texts)
        vehicle.close()
    assert (record.ending, record.reason) == ("completed", "")


@compiled_only
@pytest.mark.complete
@pytest.mark.parametrize("faults", [["taken-over:20@10.1"], ["ack-lost:0.3@10.9", "taken-over:20@11.1"]])
def test_a_pilot_who_takes_a_px4_over_before_or_as_it_follows_set_points_keeps_it(faults: list[str]) -> None:
    """Its heartbeats are sent at whole seconds, set points from 9 s on."""
    with LockstepRig("px4", faults=faults) as rig:
        rig.switch_on_failsafes()
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE["px4"])
        record = vehicle.fly(order_of("px4"), on_sample=unwatched, should_stop=never)
        assert copter_of(rig.drone).mode.name == "POSCTL"
        requests = [message for message in rig.heard if message[1].get_type() == "COMMAND_LONG"]
        modes = [number(message, "param2") for _, message in requests if number(message, "command") == 176]
        vehicle.close()
    assert modes == [4.0, 6.0][: len(faults)], "takeoff, and the offboard mode once"
    assert record.end.failure is Failure.TAKEN_OVER


def fly_with_a_stall(name: str, at_s: float, stall_s: float) -> FlightRecord:
    """A flight during which this program stalls once."""
    watcher, pending = Watcher(), [stall_s]
    with copter(name) as rig:
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE[name])

        def stall() -> None:
            if watcher.samples and watcher.samples[-1].time_s > at_s and pending:
                rig.wait_s(pending.pop())

        record = vehicle.fly(order_of(name), on_sample=watcher.see, should_stop=stall)
        vehicle.close()
    return record


@compiled_only
@pytest.mark.complete
def test_after_a_stall_each_position_has_the_reference_and_the_throttle_received_before_it() -> None:
    flight = fly_with_a_stall("ardupilot", 15.3, 0.4).trajectory
    stalled = (flight.time_s > 15.35) & (flight.time_s < 15.65)
    assert len(np.unique(flight["reference_m"][stalled] - flight["altitude_m"][stalled])) > 10
    assert len(np.unique(flight["throttle"][stalled])) > 10


@pytest.mark.complete
@compiled_only
def test_a_stall_that_interrupts_the_stream_of_set_points_ends_the_flight_as_invalid() -> None:
    record = fly_with_a_stall("px4", 15.3, 0.7)
    assert record.ending == "invalid"
    assert record.end.failure is Failure.PAUSED


def pushes_of(rig: LockstepRig) -> list[tuple[float, float]]:
    """Times of the targets that feed an acceleration forward, and these, m/s² up."""
    targets = [(at_s, message) for at_s, message in rig.heard if message.get_type() == TARGET]
    return [(at_s, -number(each, "afz")) for at_s, each in targets if not int(number(each, "type_mask")) & 1 << 8]


@pytest.mark.complete
@compiled_only
def test_a_px4_is_pushed_while_it_holds_its_altitude() -> None:
    order = order_of("px4", push_m_s2=2.0)
    with copter("px4") as rig:
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE["px4"])
        record = vehicle.fly(order, on_sample=unwatched, should_stop=never)
        pushes = pushes_of(rig)
        vehicle.close()
    assert (record.ending, record.reason) == ("completed", "")
    assert {acceleration for _, acceleration in pushes} == {-2.0}
    assert pushes[-1][0] - pushes[0][0] == pytest.approx(3.0, abs=0.1)
    flight = record.trajectory
    lowest = {name: flight["altitude_m"][(flight.time_s > begin_s) & (flight.time_s < begin_s + 3.0)].min()
              for name, begin_s in (("pushed", 21.0), ("left", 24.0))}  # fmt: skip
    assert lowest["pushed"] == pytest.approx(2.7, abs=0.1)
    assert lowest["pushed"] < lowest["left"] - 0.1
    assert flight["set_point_m"][-1] == 3.0
    steps = get_experiment("altitude-steps-px4", {**SHORT, "push_m_s2": 2.0})
    assert 0.15 < steps.error(flight) < 0.35


@compiled_only
@pytest.mark.complete
def test_a_px4_that_hears_no_more_set_points_while_it_is_pushed_lands() -> None:
    with LockstepRig("px4", faults=["deaf:30@22"]) as rig:
        rig.switch_on_failsafes()
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE["px4"])
        record = vehicle.fly(order_of("px4", push_m_s2=2.0), on_sample=unwatched, should_stop=never)
        assert rig.drone.body.stands
        vehicle.close()
    assert record.ending != "completed"


@pytest.mark.complete
@compiled_only
@pytest.mark.parametrize(("abort_at_s", "push_m_s2"), [(15.5, 0.0), (22.0, 2.0)])
def test_an_abort_during_a_px4s_step_or_push_ends_the_stream_and_lands(abort_at_s: float, push_m_s2: float) -> None:
    watcher = Watcher(abort_at_s=abort_at_s)
    with copter("px4") as rig:
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE["px4"])
        order = order_of("px4", push_m_s2=push_m_s2)
        record = vehicle.fly(order, on_sample=watcher.see, should_stop=watcher.decide)
        assert bool(pushes_of(rig)) == bool(push_m_s2)
        assert rig.drone.body.stands
        assert vehicle.read_gains() == OWN_SAFE["px4"]
        vehicle.close()
    assert (record.ending, record.reason) == ("aborted", "the operator pressed Abort")
    last_s = max(at_s for at_s, message in rig.heard if message.get_type() == TARGET)
    first_gain_s = next(at_s for at_s, message in rig.heard if at_s > last_s and message.get_type() == "PARAM_SET")
    assert first_gain_s - last_s < 0.1
    assert record.trajectory["altitude_m"][-1] < 0.3


@pytest.mark.complete
@pytest.mark.parametrize(
    ("autopilot", "parameter", "value", "needed", "correction"),
    [
        ("px4", "COM_OF_LOSS_T", 5.0, "0.5 to 2 s", "Set COM_OF_LOSS_T"),
        ("px4", "COM_OBL_RC_ACT", 0.0, "4 ", "Set COM_OBL_RC_ACT"),
        ("ardupilot", "GUID_OPTIONS", 65.0, "without bit 6", "Subtract 64 from GUID_OPTIONS"),
    ],
)
def test_what_steps_require_of_a_copter_is_checked_before_they_are_flown_and_not_for_takeoffs(
    autopilot: str, parameter: str, value: float, needed: str, correction: str
) -> None:
    with copter(autopilot) as rig:
        copter_of(rig.drone).parameters[parameter] = value
        vehicle = rig.vehicle()
        assert all(item.passed for item in vehicle.check())
        vehicle.stage(OWN_SAFE[autopilot])
        with pytest.raises(VehicleError, match=f"{parameter}: {value:g}, required: {needed}") as refusal:
            vehicle.fly(order_of(autopilot), on_sample=unwatched, should_stop=never)
        assert f"{correction} in the autopilot" in str(refusal.value)
        assert refusal.value.not_flown
        vehicle.close()


def test_no_steps_are_flown_if_a_parameter_of_the_loop_that_every_release_has_is_not_reported() -> None:
    """PSC_ACCZ_D_FF is one that older releases lack."""
    lacked = {"PSC_ACCZ_D_FF", "PSC_VELZ_FLTD"}
    with LockstepRig("ardupilot") as rig:
        autopilot = copter_of(rig.drone)
        autopilot.parameters = Parameters(
            tuple(each for each in autopilot.firmware.parameters if each.name not in lacked)
        )
        rig.switch_on_failsafes()
        vehicle = rig.vehicle()
        vehicle.stage(OWN_SAFE["ardupilot"])
        with pytest.raises(VehicleError, match=r"did not report PSC_VELZ_FLTD, of the loop that is tuned") as refusal:
            vehicle.fly(order_of("ardupilot"), on_sample=unwatched, should_stop=never)
        assert refusal.value.not_flown
        vehicle.close()
