"""What tells one vehicle's logs from another's: the id of its board, its name; and its parameters at the end."""

import io
import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.mavlink import hardware_id
from app.autopilots.paparazzi.log import read_paparazzi
from app.autopilots.px4.log import read_px4
from app.autopilots.recording import Recording, final_parameters
from app.autopilots.tlog import read_tlog
from tests.core.analysis.flights import QUIET, simulated_flight
from tests.core.analysis.px4_flights import simulated_px4
from tests.logs.recorded import OnBoardLog, Telemetry, ULogFile, recorded
from tests.logs.written import ARMED, DISARMED, LANDED, NOT_LANDED, ardupilot_log
from tests.logs.written_px4 import px4_log

SERIAL = bytes.fromhex("1f0035000e51363431333137")
"""The twelve bytes in a processor's memory: of the wafer, and the lot as text."""
UID2 = SERIAL.ljust(18, b"\0")
PX4_ID = bytes.fromhex("000600000000") + SERIAL[::-1]
MACHINE = b"bd1219c7c4c5404aaa1f6d2a48adfda4"


def on_board(*messages: bytes) -> Recording:
    """ArduPilot's log with these messages."""
    log = OnBoardLog()
    log.define(1, "MSG", "QZ", "TimeUS,Message")
    for place, each in enumerate(messages):
        log.add(1, "<Q64s", 10_000 * place, each)
    return read_ardupilot(io.BytesIO(log.content))


def telemetry(*, uid: int = 0, uid2: bytes = b"", autopilot: int = 3) -> Recording:
    """A log of a vehicle that answers with these ids."""
    log = Telemetry(ardupilotmega, autopilot=autopilot)
    log.heartbeat()
    log.fly(0.1, to_m=0.0)
    log.vehicle("autopilot_version", 0, 4 << 24, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, uid, uid2.ljust(18, b"\0"))
    return read_tlog(io.BytesIO(log.content))


def ulog(text: bytes, kind: str = "") -> Recording:
    log = ULogFile()
    log.information(f"{kind or f'char[{len(text)}]'} sys_uuid", text)
    return read_px4(io.BytesIO(log.content))


def test_a_board_has_one_id_in_its_own_log_and_over_the_link() -> None:
    words = [SERIAL[place : place + 4][::-1].hex() for place in (0, 4, 8)]
    for line in (" ".join(["fmuv3", *words]), " ".join(["CubeOrange Plus", *words]).upper()):
        found = on_board(b"ArduCopter V4.6.1 (3fc7011a)", b"ChibiOS: d4fce84e", line.encode())
        assert found.hardware_id == telemetry(uid2=UID2).hardware_id == UID2.hex()
    assert ulog(PX4_ID.hex().upper().encode()).hardware_id == telemetry(uid2=PX4_ID, autopilot=12).hardware_id
    assert ulog(PX4_ID.hex().encode()).hardware_id == PX4_ID.hex()


def test_a_link_of_mavlink_1_has_the_shorter_id_alone() -> None:
    short = int.from_bytes(SERIAL[:8], "little")
    assert telemetry(uid=short).hardware_id == SERIAL[:8][::-1].hex()
    assert telemetry(uid=short, uid2=UID2).hardware_id == UID2.hex()


@pytest.mark.parametrize(
    "shared",
    [b"\0" * 18, b"\xff" * 18, b"\xff" * 12 + b"\0" * 6, PX4_ID[:6] + bytes(12), MACHINE[:18], b"<" + MACHINE[1:18]],
)
def test_what_simulations_and_missing_memories_send_is_no_id(shared: bytes) -> None:
    assert not telemetry(uid2=shared).hardware_id
    assert not ulog(shared.hex().encode()).hardware_id


def test_ids_in_other_forms_are_none() -> None:
    assert not on_board(b"ArduCopter V4.7.0", MACHINE).hardware_id
    assert not on_board(b"fmuv3 0035001F 3436510E", b"fmuv3 FFFFFFFF FFFFFFFF FFFFFFFF").hardware_id
    assert not telemetry(uid=int.from_bytes(b"GAINLIN\3", "big")).hardware_id
    for text in (b"not hexadecimal", b"0006", "000600000é".encode()):
        assert not ulog(text).hardware_id
    assert not ulog(struct.pack("<Q", 7), "uint64_t").hardware_id
    assert hardware_id(PX4_ID.hex()[:-1]) == ""


def test_recorded_simulations_have_no_id_and_paparazzi_has_a_name() -> None:
    assert not read_ardupilot(io.BytesIO(recorded("arducopter_steps.bin"))).hardware_id
    assert not read_px4(io.BytesIO(recorded("px4_takeoff.ulg"))).hardware_id
    assert not read_tlog(io.BytesIO(recorded("paparazzi_283_13_82.tlog"))).hardware_id
    data, companion = (io.BytesIO(recorded(f"paparazzi_steps.{end}")) for end in ("data", "log"))
    assert not read_paparazzi(data).vehicle_name
    assert read_paparazzi(data, companion).vehicle_name == "gl (31)"


def test_parameters_are_those_last_known_in_flight() -> None:
    changes = ((12.0, "PSC_ACCZ_P", 0.7), (21.0, "PSC_ACCZ_P", 0.2), (21.0, "LAND_SPEED", 30.0))
    events = ((0.0, ARMED), (0.0, NOT_LANDED), (20.0, LANDED), (20.5, DISARMED))

    def final(*more: tuple[float, int]) -> dict[str, float]:
        log = ardupilot_log(simulated_flight(QUIET), changes=changes, events=(*events, *more))
        return final_parameters(read_ardupilot(io.BytesIO(log)))

    assert final()["PSC_ACCZ_P"] == pytest.approx(0.7)
    assert final()["LAND_SPEED"] == pytest.approx(30.0)
    assert final((22.0, NOT_LANDED))["PSC_ACCZ_P"] == pytest.approx(0.2)


def test_px4_logs_keep_all_parameters_until_the_touchdown() -> None:
    parameters = {"MPC_Z_P": 1.0, "SYS_AUTOSTART": 4001, "CAL_ACC0_ID": 1_310_988}
    changes = ((5.0, "MPC_Z_P", 1.5), (12.0, "MPC_Z_P", 1.2))
    log = px4_log(
        simulated_px4(), parameters=parameters, changes=changes, landed=((0.0, True), (1.0, False), (10.0, True))
    )
    recording = read_px4(io.BytesIO(log))
    assert final_parameters(recording) == {**parameters, "MPC_Z_P": 1.5}
    assert len(final_parameters(read_px4(io.BytesIO(recorded("px4_takeoff.ulg"))))) == 869


def test_the_number_of_parameters_is_limited_and_their_names_are_checked() -> None:
    log = ULogFile()
    for place in range(5_010):
        log.parameter(f"P{place}", 1.0)
    log.parameter("lower_case", 1.0)
    log.parameter("P0", 2.0, at_s=3.0)
    found = final_parameters(read_px4(io.BytesIO(log.content)))
    assert (len(found), found["P0"]) == (5_000, 2.0)
