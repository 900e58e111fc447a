"""What messages mean and what is sent, held against recorded traffic of the real Paparazzi and the facts of others."""

import math
import struct
from collections.abc import Mapping
from dataclasses import replace

import pytest

from app.autopilots.autopilot import Autopilot, AutopilotError, check_gains
from app.autopilots.commands import Action, Outgoing, Setting, Target
from app.autopilots.dialects import FieldValue, Message, number, text
from app.autopilots.measurements import (
    Battery,
    Block,
    BlockCount,
    BlockEntered,
    CommandReply,
    FenceBreach,
    Heartbeat,
    InvalidPosition,
    Measurement,
    Parameter,
    Position,
    Throttle,
    Version,
)
from app.autopilots.registry import AUTOPILOTS
from app.core.errors import GainsError
from app.vehicles.mavlink.parameters import settings
from tests.vehicles.mavlink.replaying import FLOWN, VEHICLE, messages, recorded

PAPARAZZI, ARDUPILOT, PX4 = (AUTOPILOTS[name] for name in ("paparazzi", "ardupilot", "px4"))
SAFE = {"kp": 283, "ki": 13, "kd": 82}


def measured(gains: tuple[int, int, int], kind: str) -> list[Measurement]:
    """What the profile makes of one kind of the vehicle's recorded messages."""
    found = [PAPARAZZI.measure(each.message) for each in messages(gains, kind, from_vehicle=True)]
    return [each for each in found if each is not None]


def aim(gains: tuple[int, int, int] = FLOWN[0]) -> Target:
    """The recorded vehicle, its blocks as it listed them."""
    blocks = {block.name: block.number for block in measured(gains, "SCRIPT_ITEM") if isinstance(block, Block)}
    return Target(system=VEHICLE, aircraft=VEHICLE, blocks=blocks)


def heard(profile: Autopilot, kind: str, **fields: FieldValue) -> Measurement | None:
    """What the profile makes of a message that came over the wire."""
    codec = profile.dialect.codec(system=1, component=1)
    [message] = codec.parse(codec.pack(profile.dialect.message(kind, fields)))
    return profile.measure(message)


def sent(profile: Autopilot, action: Action, aim: Target) -> list[Outgoing]:
    return [message for step in profile.steps(action, aim) for message in step.sends]


def fields(message: Message) -> dict[str, FieldValue]:
    return {name: getattr(message, name) for name in message.get_fieldnames()}


def on_the_wire(outgoing: Outgoing) -> tuple[str, Mapping[str, FieldValue]]:
    """As a receiver decodes it."""
    codec = PAPARAZZI.dialect.codec(system=255, component=190)
    [message] = codec.parse(codec.pack(PAPARAZZI.dialect.message(outgoing.kind, outgoing.fields)))
    return message.get_type(), fields(message)


@pytest.mark.parametrize("gains", FLOWN)
def test_the_recorded_read_backs_are_the_gains_that_were_flown(gains: tuple[int, int, int]) -> None:
    asked = [text(each.message, "param_id") for each in messages(gains, "PARAM_REQUEST_READ", from_vehicle=False)]
    latest = {each.name: each.value for each in measured(gains, "PARAM_VALUE") if isinstance(each, Parameter)}
    [gain_set] = PAPARAZZI.gain_sets
    assert asked == ["gui_v_kp", "gui_v_ki", "gui_v_kd"]
    assert tuple(gain.read(latest[gain.parameter]) for gain in gain_set) == gains


@pytest.mark.parametrize("gains", FLOWN)
def test_what_is_sent_is_what_the_recorded_trial_was_flown_with(gains: tuple[int, int, int]) -> None:
    told = [
        (each.kind, fields(each.message))
        for each in recorded(gains)
        if not each.is_from_vehicle and each.kind in {"MISSION_ACK", "SCRIPT_ITEM"}
    ]
    whom = aim(gains)
    ends_listing = PAPARAZZI.conclude(whom)
    arming = [message for message in sent(PAPARAZZI, Action.ARM, whom) if message.kind != "MISSION_ITEM"]
    ours = [*ends_listing, *arming, *sent(PAPARAZZI, Action.TAKE_OFF, whom), *sent(PAPARAZZI, Action.LAND, whom)]
    assert [on_the_wire(message) for message in ours] == told


@pytest.mark.parametrize("gains", FLOWN)
def test_the_waypoint_is_the_recorded_one_but_straight_above_the_vehicle(gains: tuple[int, int, int]) -> None:
    [flown] = messages(gains, "MISSION_ITEM", from_vehicle=False)
    [waypoint] = [message for message in sent(PAPARAZZI, Action.ARM, aim(gains)) if message.kind == "MISSION_ITEM"]
    assert on_the_wire(waypoint) == ("MISSION_ITEM", fields(flown.message) | {"x": 0.0, "y": 0.0})
    assert number(flown.message, "z") == 3.0


@pytest.mark.parametrize("gains", FLOWN)
def test_gains_and_the_kill_are_written_as_they_were_recorded(gains: tuple[int, int, int]) -> None:
    told = [(each.kind, fields(each.message)) for each in messages(gains, "PARAM_SET", from_vehicle=False)]
    [gain_set] = PAPARAZZI.gain_sets
    whom = aim(gains)
    writes = [
        PAPARAZZI.set_parameter(whom, gain.parameter, gain.sent(value))
        for gain, value in zip(gain_set, gains, strict=True)
    ]
    stops = [on_the_wire(message) for message in sent(PAPARAZZI, Action.MOTORS_OFF, whom)]
    assert [*(on_the_wire(message) for message in writes), stops[1]] == told
    assert (stops[0][0], stops[0][1]["command"], stops[0][1]["param1"]) == ("COMMAND_LONG", 400, 0.0)


@pytest.mark.parametrize(
    ("found", "written"),
    [(("kil_thr",), {"kil_thr"}), (("aut_kil_thr",), {"aut_kil_thr"}), ((), {"kil_thr", "aut_kil_thr"})],
)
def test_the_motors_are_stopped_by_the_command_and_by_the_setting_that_was_found(
    found: tuple[str, ...], written: set[str]
) -> None:
    for action in (Action.MOTORS_OFF, Action.KILL):
        first, *others = sent(PAPARAZZI, action, replace(aim(), stop_settings=found))
        assert (first.kind, first.fields["command"], first.fields["param1"]) == ("COMMAND_LONG", 400, 0.0)
        assert {str(message.fields["param_id"]) for message in others} == written
        assert {message.fields["param_value"] for message in others} == {1.0}


def test_the_recorded_vehicle_is_paparazzi_armed_between_its_blocks_with_a_full_battery() -> None:
    beats = [each for each in measured(FLOWN[0], "HEARTBEAT") if isinstance(each, Heartbeat)]
    assert {(beat.autopilot, beat.mode, beat.system) for beat in beats} == {(9, "4", VEHICLE)}
    armed = [beat.armed for beat in beats]
    assert (armed[0], armed[len(armed) // 2], armed[-1]) == (False, True, False)
    assert set(measured(FLOWN[0], "SYS_STATUS")) == {Battery(12.4)}
    assert measured(FLOWN[0], "SCRIPT_COUNT") == [BlockCount(18)]


def test_positions_are_turned_upside_down() -> None:
    first = messages(FLOWN[0], "LOCAL_POSITION_NED", from_vehicle=True)[0].message
    position = PAPARAZZI.measure(first)
    assert isinstance(position, Position)
    assert (position.time_boot_s, position.altitude_m) == (36.997, 0.10546875)
    assert position.climb_rate_m_s == pytest.approx(0.00578, abs=1e-5)


def test_messages_that_mix_their_units_measure_nothing() -> None:
    for kind in ("GLOBAL_POSITION_INT", "BATTERY_STATUS"):
        assert not measured(FLOWN[0], kind)
        assert messages(FLOWN[0], kind, from_vehicle=True)
    assert {type(each) for each in measured(FLOWN[0], "VFR_HUD")} == {Throttle}


def test_land_comes_with_the_acknowledgement_that_frees_the_blocks() -> None:
    assert [message.kind for message in sent(PAPARAZZI, Action.LAND, aim())] == ["MISSION_ACK", "SCRIPT_ITEM"]


def test_blocks_go_by_the_system_id_and_the_rest_by_the_aircraft_id() -> None:
    whom = Target(system=7, aircraft=31, blocks=aim().blocks)
    by_kind = {
        message.kind: message.fields["target_system"] for action in Action for message in sent(PAPARAZZI, action, whom)
    }
    assert by_kind == {"MISSION_ITEM": 7, "MISSION_ACK": 7, "SCRIPT_ITEM": 7, "PARAM_SET": 31, "COMMAND_LONG": 31}


def answers(listed: Mapping[int, str], count: int) -> "Recorder":
    return Recorder({number: Block(number, name) for number, name in listed.items()}, BlockCount(count))


class Recorder:
    """A vehicle that answers requests for its blocks."""

    def __init__(self, blocks: Mapping[int, Block], count: BlockCount) -> None:
        self.blocks, self.count = blocks, count
        self.asked: list[str] = []

    def __call__(self, request: Outgoing, fits: object) -> Measurement | None:
        self.asked.append(request.kind)
        seq = request.fields.get("seq")
        return self.blocks.get(seq) if isinstance(seq, int) else self.count


def test_a_flight_plan_begins_again_where_it_has_blocks_that_set_the_ground_reference() -> None:
    def told(*missing: str) -> list[FieldValue]:
        blocks = {name: number for name, number in aim().blocks.items() if name not in missing}
        steps = PAPARAZZI.refer_to_ground(replace(aim(), blocks=blocks))
        return [message.fields["seq"] for step in steps for message in step.sends if message.kind == "SCRIPT_ITEM"]

    assert (told(), told("Wait GPS"), told("Geo init")) == ([0], [1], [])


@pytest.mark.parametrize(
    ("present", "health", "may_arm"),
    [(33570863, 320915519, True), (33570863, 52480063, None), (33570863 | 1 << 28, 52480063, False)],
)
def test_px4_reports_that_it_may_be_armed_by_the_health_alone(present: int, health: int, may_arm: bool | None) -> None:
    """As recorded on the ground and where it refused, both of release 1.17; until 1.13 the bit was present, too."""
    bits = {"onboard_control_sensors_present": present, "onboard_control_sensors_health": health}
    errors = [f"errors_count{count}" for count in range(1, 5)]
    others = ("onboard_control_sensors_enabled", "load", "drop_rate_comm", "errors_comm", *errors)
    fields = dict.fromkeys(others, 0) | {"voltage_battery": 16200, "current_battery": -100, "battery_remaining": 100}
    assert heard(PX4, "SYS_STATUS", **bits, **fields) == Battery(16.2, may_arm)


@pytest.mark.parametrize(
    ("mode", "may_arm", "leaves"),
    [
        ("4.3", True, False),
        ("4.3", False, False),
        ("4.2", True, True),
        ("4.4", True, True),
        ("4.6", True, True),
        ("6.0", None, True),
        ("3.0", True, False),
        ("3.0", None, False),
        ("3.0", False, True),
    ],
)
def test_px4_leaves_every_mode_in_which_it_does_not_arm_or_takes_off_at_once(
    mode: str, may_arm: bool | None, leaves: bool
) -> None:
    """Offboard, land, takeoff and mission, and a pilot's mode only if it reports that it does not arm in it."""
    steps = PX4.make_armable(aim(), mode, may_arm=may_arm)
    assert [[each.fields[f"param{count}"] for count in (2, 3)] for step in steps for each in step.sends] == [
        [4, 3]
    ] * leaves


def test_the_flight_plan_is_listed_block_by_block() -> None:
    names = {number: name for name, number in aim().blocks.items()}
    ask = answers(names, len(names))
    assert PAPARAZZI.explore(ask, aim()) == aim().blocks
    assert ask.asked == ["SCRIPT_REQUEST_LIST", *["SCRIPT_REQUEST"] * len(names)]


def test_a_flight_plan_without_a_block_to_land_is_not_flown() -> None:
    with pytest.raises(AutopilotError, match="no block land here"):
        PAPARAZZI.explore(answers({0: "Holding point", 1: "Start Engine", 2: "Takeoff"}, 3), aim())
    with pytest.raises(AutopilotError, match="did not name block 1 of 2"):
        PAPARAZZI.explore(answers({0: "Holding point"}, 2), aim())


def test_gains_are_clamped_here_because_no_autopilot_does() -> None:
    [gain_set] = PAPARAZZI.gain_sets
    assert check_gains({"kd": 82.0, "kp": 283.0, "ki": 13.0}, gain_set) == SAFE
    with pytest.raises(GainsError) as refusal:
        check_gains({"kp": -5, "ki": 300.7, "kd": 82, "nom_thr": 1}, gain_set)
    assert {(problem.field, problem.reason) for problem in refusal.value.problems} == {
        ("gains.nom_thr", "is not a gain of this vehicle"),
        ("gains.kp", "must be between 0 and 4000, got -5"),
        ("gains.ki", "must be a whole number of counts, got 300.7"),
    }


@pytest.mark.parametrize("profile", AUTOPILOTS.values(), ids=AUTOPILOTS)
def test_whatever_its_experiment_lets_pass_may_be_written_under_the_names_of_every_release(profile: Autopilot) -> None:
    space = profile.experiments[0].space
    for gain_set in profile.gain_sets:
        for edge in (space.lower, space.default, space.upper):
            gains = space.mapping(edge)
            assert check_gains(gains, gain_set) == gains


@pytest.mark.parametrize("profile", AUTOPILOTS.values(), ids=AUTOPILOTS)
def test_the_gains_of_a_vehicle_have_the_order_of_its_experiment(profile: Autopilot) -> None:
    for gain_set in profile.gain_sets:
        assert tuple(gain.gain for gain in gain_set) == profile.experiments[0].space.names


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400])
def test_what_is_no_number_is_never_written(value: float) -> None:
    for profile in AUTOPILOTS.values():
        for gain_set in profile.gain_sets:
            with pytest.raises(GainsError):
                check_gains({gain.gain: value for gain in gain_set}, gain_set)


def test_in_the_air_the_gain_that_clears_the_integrator_comes_last() -> None:
    [gain_set] = PAPARAZZI.gain_sets
    assert [setting.parameter for setting in settings(gain_set, SAFE)] == ["gui_v_kp", "gui_v_kd", "gui_v_ki"]
    for profile in AUTOPILOTS.values():
        for known in profile.gain_sets:
            assert settings(known, {gain.gain: gain.lower for gain in known})[-1].parameter.endswith(
                ("i", "I", "I_ACC")
            )


def test_a_fraction_that_the_vehicle_cut_off_shows_in_the_read_back() -> None:
    [gain_set] = PAPARAZZI.gain_sets
    assert gain_set[0].read(300.7) == 300


def test_a_gain_in_single_precision_is_read_back_as_it_was_asked() -> None:
    gain = ARDUPILOT.gain_sets[1][2]
    assert gain.parameter == "PSC_D_ACC_P"
    wire = gain.sent(0.37)
    assert wire == struct.unpack("<f", struct.pack("<f", 0.037))[0]
    assert gain.read(wire, 0.37) == 0.37
    assert gain.read(gain.sent(0.38), 0.37) == pytest.approx(0.38)


def test_both_names_of_arducopters_gains_are_known_as_one() -> None:
    old, new = ARDUPILOT.gain_sets
    assert [gain.gain for gain in old] == [gain.gain for gain in new]
    assert [gain.factor for gain in new] == [1.0, 1.0, 0.1, 0.1, 0.1]


def test_px4s_whole_numbers_come_bytewise() -> None:
    (as_float,) = struct.unpack("<f", struct.pack("<i", 3))
    common: dict[str, FieldValue] = {"param_id": "NAV_DLL_ACT", "param_value": as_float, "param_type": 6}
    assert heard(PX4, "PARAM_VALUE", **common, param_count=1, param_index=0) == Parameter("NAV_DLL_ACT", 3.0)
    assert heard(
        PX4, "PARAM_VALUE", param_id="MPC_Z_P", param_value=0.5, param_type=9, param_count=1, param_index=0
    ) == Parameter("MPC_Z_P", 0.5)


def heartbeat(profile: Autopilot, custom_mode: int, base_mode: int = 209) -> Measurement | None:
    beat = {"type": 2, "autopilot": profile.autopilot, "base_mode": base_mode, "custom_mode": custom_mode}
    return heard(profile, "HEARTBEAT", **beat, system_status=4, mavlink_version=3)


def test_modes_are_told_apart() -> None:
    guided, landing = heartbeat(ARDUPILOT, 4), heartbeat(ARDUPILOT, 9)
    assert isinstance(guided, Heartbeat)
    assert isinstance(landing, Heartbeat)
    assert guided.mode in ARDUPILOT.flying_modes
    assert landing.mode in ARDUPILOT.landing_modes
    for sub, modes in ((2, PX4.flying_modes), (3, PX4.flying_modes), (6, PX4.landing_modes)):
        beat = heartbeat(PX4, 4 << 16 | sub << 24)
        assert isinstance(beat, Heartbeat)
        assert beat.mode in modes


def test_a_command_under_way_is_no_answer_yet() -> None:
    assert heard(PX4, "COMMAND_ACK", command=400, result=5) is None
    assert heard(PX4, "COMMAND_ACK", command=400, result=0) == CommandReply("command 400", True, "result 0, accepted")
    for result, why in ((1, "result 1, temporarily rejected"), (4, "result 4, failed")):
        assert heard(ARDUPILOT, "COMMAND_ACK", command=400, result=result) == CommandReply("command 400", False, why)


def test_a_breached_fence_is_reported() -> None:
    known = {"breach_count": 1, "breach_type": 2, "breach_time": 0}
    assert heard(ARDUPILOT, "FENCE_STATUS", breach_status=1, **known) == FenceBreach("its greatest altitude")
    assert heard(ARDUPILOT, "FENCE_STATUS", breach_status=0, **known) is None


def commands(profile: Autopilot, action: Action) -> list[tuple[FieldValue, ...]]:
    whom = Target(system=1, aircraft=1)
    return [
        (message.fields["command"], *(message.fields[f"param{place}"] for place in range(1, 8)))
        for message in sent(profile, action, whom)
    ]


def test_arducopter_takes_off_in_guided_mode_and_lands_in_its_own() -> None:
    assert commands(ARDUPILOT, Action.ARM) == [(176, 1, 4, 0, 0, 0, 0, 0), (400, 1, 0, 0, 0, 0, 0, 0)]
    assert commands(ARDUPILOT, Action.TAKE_OFF) == [(22, 0, 0, 0, 0, 0, 0, 3)]
    assert commands(ARDUPILOT, Action.LAND) == [(176, 1, 9, 0, 0, 0, 0, 0)]


def test_px4_takes_off_by_its_mode_to_the_altitude_of_its_parameter() -> None:
    assert PX4.take_off_settings(Target(system=1, aircraft=1)) == (Setting("MIS_TAKEOFF_ALT", 3.0),)
    assert commands(PX4, Action.ARM) == [(400, 1, 0, 0, 0, 0, 0, 0)]
    assert commands(PX4, Action.TAKE_OFF) == [(176, 1, 4, 2, 0, 0, 0, 0)]
    assert commands(PX4, Action.LAND) == [(176, 1, 4, 6, 0, 0, 0, 0)]


@pytest.mark.parametrize("profile", [ARDUPILOT, PX4], ids=["ardupilot", "px4"])
def test_every_message_that_a_trial_listens_to_is_asked_for(profile: Autopilot) -> None:
    steps = profile.prepare(Target(system=1, aircraft=1), 125.0)
    asked = [(step.sends[0].fields, step.needed) for step in steps]
    assert {fields["command"] for fields, _ in asked} == {511}
    assert [(fields["param1"], needed) for fields, needed in asked] == [
        (32, True),
        (1, True),
        (245, False),
        (162, False),
        (74, False),
        (30, False),
    ]
    assert asked[0][0]["param2"] == 8000


@pytest.mark.parametrize("profile", [ARDUPILOT, PX4], ids=["ardupilot", "px4"])
def test_nobody_is_armed_or_disarmed_by_force(profile: Autopilot) -> None:
    for action in (Action.ARM, Action.MOTORS_OFF):
        assert all(second == 0 for command, _, second, *_ in commands(profile, action) if command == 400)


@pytest.mark.parametrize("profile", AUTOPILOTS.values(), ids=AUTOPILOTS)
def test_everything_that_is_sent_can_be_packed(profile: Autopilot) -> None:
    whom = aim()
    steps = [*profile.prepare(whom, 50.0), *(step for action in Action for step in profile.steps(action, whom))]
    for message in (message for step in steps for message in step.sends):
        assert profile.dialect.message(message.kind, message.fields).get_type() == message.kind


def test_motors_off_at_any_height_is_the_one_command_that_is_forced() -> None:
    whom = Target(system=1, aircraft=1)
    for profile in (ARDUPILOT, PX4):
        [message] = sent(profile, Action.KILL, whom)
        assert (message.kind, [message.fields[f"param{place}"] for place in (1, 2)]) == ("COMMAND_LONG", [0.0, 21196.0])
    assert sent(PAPARAZZI, Action.KILL, aim()) == sent(PAPARAZZI, Action.MOTORS_OFF, aim())


def test_a_gimbal_or_a_companion_computer_is_not_taken_for_the_autopilot() -> None:
    said: dict[str, FieldValue] = {"base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
    for profile in AUTOPILOTS.values():
        for kind in (6, 18, 26, 30):
            assert heard(profile, "HEARTBEAT", autopilot=8, type=kind, **said) is None
            assert heard(profile, "HEARTBEAT", autopilot=profile.autopilot, type=kind, **said) is None
        assert isinstance(heard(profile, "HEARTBEAT", autopilot=profile.autopilot, type=2, **said), Heartbeat)


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["x", "y", "z", "vz"])
def test_values_that_are_not_numbers_are_not_a_position(field: str, nothing: float) -> None:
    sample: dict[str, FieldValue] = {
        "time_boot_ms": 1000,
        "x": 0.0,
        "y": 0.0,
        "z": -1.0,
        "vx": 0.0,
        "vy": 0.0,
        "vz": 0.0,
    }
    for profile in AUTOPILOTS.values():
        assert isinstance(heard(profile, "LOCAL_POSITION_NED", **sample), Position)
        assert heard(profile, "LOCAL_POSITION_NED", **sample | {field: nothing}) == InvalidPosition(1.0)


def test_what_is_no_number_is_no_parameter() -> None:
    held: dict[str, FieldValue] = {
        "param_id": "gui_v_kp",
        "param_value": math.nan,
        "param_type": 9,
        "param_count": 76,
        "param_index": 6,
    }
    assert heard(PAPARAZZI, "PARAM_VALUE", **held) is None


def test_a_version_is_read_as_each_autopilot_writes_it() -> None:
    nothing: dict[str, FieldValue] = {
        **dict.fromkeys(("flight_custom_version", "middleware_custom_version", "os_custom_version"), [0] * 8),
        **dict.fromkeys(("capabilities", "middleware_sw_version", "os_sw_version", "board_version"), 0),
        **dict.fromkeys(("vendor_id", "product_id", "uid"), 0),
    }
    written = {"paparazzi": 51000, "ardupilot": 0x040603FF, "px4": 0x011000FF}
    told = {
        name: heard(AUTOPILOTS[name], "AUTOPILOT_VERSION", flight_sw_version=n, **nothing)
        for name, n in written.items()
    }
    assert told == {"paparazzi": Version("5.10.0"), "ardupilot": Version("4.6.3"), "px4": Version("1.16.0")}
    assert heard(PX4, "AUTOPILOT_VERSION", flight_sw_version=0, **nothing) is None


@pytest.mark.parametrize(
    ("uid", "uid2", "told"),
    [
        (0x0102030405060708, [0] * 18, "0102030405060708"),
        (0x0102030405060708, [0xAB, *range(17)], "ab000102030405060708090a0b0c0d0e0f10"),
        (0, [0] * 18, ""),
    ],
)
def test_the_hardware_id_is_the_longer_one_where_it_is_told(uid: int, uid2: list[int], told: str) -> None:
    nothing: dict[str, FieldValue] = {
        **dict.fromkeys(("flight_custom_version", "middleware_custom_version", "os_custom_version"), [0] * 8),
        **dict.fromkeys(("capabilities", "middleware_sw_version", "os_sw_version", "board_version"), 0),
        **dict.fromkeys(("vendor_id", "product_id"), 0),
    }
    for profile in (ARDUPILOT, PX4):
        heard_of = heard(profile, "AUTOPILOT_VERSION", flight_sw_version=0x01100000, uid=uid, uid2=uid2, **nothing)
        assert heard_of == Version("1.16.0", told)


def test_paparazzi_tells_every_change_of_block() -> None:
    entered = measured(FLOWN[0], "SCRIPT_CURRENT")
    names = {number: name for name, number in aim().blocks.items()}
    assert [names[each.number] for each in entered if isinstance(each, BlockEntered)][:3] == [
        "Start Engine",
        "Takeoff",
        "land",
    ]


@pytest.mark.parametrize(
    ("profile", "parameter", "protects", "does_not"),
    [
        (ARDUPILOT, "FS_GCS_ENABLE", {5.0}, {0.0, 1.0, 2.0}),
        (ARDUPILOT, "FS_GCS_TIMEOUT", {5.0, 15.0}, {0.0, 120.0}),
        (ARDUPILOT, "SYSID_MYGCS", {255.0}, {0.0, 1.0, 254.0}),
        (ARDUPILOT, "FENCE_ENABLE", {1.0}, {0.0}),
        (ARDUPILOT, "FENCE_TYPE", {1.0, 3.0, 7.0}, {0.0, 2.0, 6.0}),
        (ARDUPILOT, "FENCE_ACTION", {2.0, 4.0}, {0.0, 1.0, 3.0, 5.0}),
        (ARDUPILOT, "FENCE_ALT_MAX", {5.0, 10.0}, {0.0, 100.0}),
        (ARDUPILOT, "FS_EKF_ACTION", {1.0, 3.0}, {0.0, 2.0}),
        (PX4, "NAV_DLL_ACT", {3.0}, {0.0, 1.0, 5.0, 6.0}),
        (PX4, "COM_DL_LOSS_T", {5.0, 15.0}, {0.0, 300.0}),
        (PX4, "GF_ACTION", {2.0, 5.0}, {0.0, 1.0, 3.0, 4.0}),
        (PX4, "GF_MAX_VER_DIST", {5.0, 10.0}, {0.0, 120.0}),
        (ARDUPILOT, "GUID_OPTIONS", {0.0, 1.0, 191.0}, {64.0, 65.0}),
        (PX4, "COM_OF_LOSS_T", {0.5, 2.0}, {0.0, 0.4, 5.0}),
        (PX4, "COM_FAIL_ACT_T", {0.0, 5.0}, {5.1, 25.0}),
        (PX4, "COM_OBL_RC_ACT", {4.0}, {0.0, 3.0, 5.0}),
    ],
)
def test_only_a_failsafe_that_brings_the_vehicle_down_without_climbing_or_stopping_its_motors_will_do(
    profile: Autopilot, parameter: str, protects: set[float], does_not: set[float]
) -> None:
    every = (*profile.requirements, *profile.set_point_requirements)
    requirement = next(each for each in every if each.parameter == parameter)
    assert {value for value in protects | does_not if requirement.is_met(value)} == protects


@pytest.mark.parametrize(
    ("profile", "modes"),
    [
        (PAPARAZZI, {"64", "80", "16"}),
        (ARDUPILOT, {"0", "1", "2", "5", "7", "11", "13", "14", "15", "16", "18", "22", "24", "25", "28", "42"}),
        (PX4, {"1.0", "2.0", "3.0", "3.1", "3.2", "5.0", "7.0", "8.0", "11.0", "12.0"}),
    ],
)
def test_a_pilot_flies_in_every_mode_that_is_not_automatic_also_in_those_of_later_releases(
    profile: Autopilot, modes: set[str]
) -> None:
    """Seen: in AutoTune, FlowHold, Position slow and others Land was sent once a second against the pilot."""
    assert not modes & profile.automatic_modes
    assert profile.flying_modes | profile.landing_modes <= profile.automatic_modes


@pytest.mark.parametrize(("base_mode", "mode"), [(4, "4"), (5, "4"), (133, "4"), (65, "64"), (209, "80")])
def test_paparazzis_mode_is_read_with_and_without_the_bit_for_a_custom_mode(base_mode: int, mode: str) -> None:
    beat = heard(
        PAPARAZZI,
        "HEARTBEAT",
        type=2,
        autopilot=9,
        base_mode=base_mode,
        custom_mode=0,
        system_status=4,
        mavlink_version=3,
    )
    assert isinstance(beat, Heartbeat)
    assert beat.mode == mode


@pytest.mark.parametrize("profile", [ARDUPILOT, PX4])
def test_a_copters_set_point_is_a_target_of_position_alone_that_it_must_report(profile: Autopilot) -> None:
    target = Target(system=1, aircraft=1, component=1, north_m=2.0, east_m=-1.0, altitude_m=2.5)
    [step] = profile.steps(Action.FLY_TO, target)
    [message] = step.sends
    assert message.kind == "SET_POSITION_TARGET_LOCAL_NED"
    told = {name: message.fields[name] for name in ("coordinate_frame", "type_mask", "x", "y", "z")}
    assert told == {"coordinate_frame": 1, "type_mask": 0b110111111000, "x": 2.0, "y": -1.0, "z": -2.5}
    assert (step.awaits, step.altitude_m, step.attempts) == ("position target", 2.5, 3)
    assert profile.stream(target) == (() if profile is ARDUPILOT else (message,))


def test_paparazzis_set_point_is_its_waypoint_and_is_acknowledged() -> None:
    target = Target(system=31, aircraft=31, east_m=-1.0, altitude_m=2.0)
    [step] = PAPARAZZI.steps(Action.FLY_TO, target)
    assert [(message.kind, message.fields["seq"], message.fields["z"]) for message in step.sends] == [
        ("MISSION_ITEM", 2, 2.0)
    ]
    assert (step.awaits, step.attempts) == ("waypoint", 3)
