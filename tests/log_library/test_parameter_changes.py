"""Differences between the parameters of two logs."""

import io
from collections.abc import Mapping
from pathlib import Path

import pytest
from pymavlink import DFReader

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.profile import ARDUPILOT
from app.autopilots.autopilot import Autopilot
from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.px4.profile import PX4
from app.autopilots.recording import final_parameters
from app.log_library.parameter_changes import ParameterChange, ParameterGroup, parameter_changes
from tests.logs.recorded import recorded

GAIN, LOOP, OTHER, SELF_WRITTEN, UNKNOWN = ParameterGroup


def truth(path: Path) -> dict[str, float]:
    """The parameters of a log as pymavlink has them, without those that the firmware writes at the end of a flight."""
    reader, found = DFReader.DFReader_binary(str(path)), {}
    while (message := reader.recv_match(type=["PARM"])) is not None:
        found[message.Name] = message.Value
    reader.data_map.close()
    reader.filehandle.close()
    return {name: value for name, value in found.items() if not name.startswith("STAT_")}


@pytest.fixture
def two_logs(tmp_path: Path) -> tuple[Path, Path]:
    paths = tmp_path / "steps.bin", tmp_path / "lateral_steps.bin"
    for path in paths:
        path.write_bytes(recorded(f"arducopter_{path.name}"))
    return paths


def test_two_recorded_logs_differ_in_every_changed_parameter_and_no_other(two_logs: tuple[Path, Path]) -> None:
    values = [final_parameters(read_ardupilot(io.BytesIO(path.read_bytes()))) for path in two_logs]
    found = parameter_changes(ARDUPILOT, *values)
    old, new = map(truth, two_logs)
    expected = {name: (old.get(name), new.get(name)) for name in old.keys() | new.keys()}
    changed = {name: both for name, both in expected.items() if both[0] != both[1]}
    assert {each.name: (each.before, each.after) for each in found if "STAT_" not in each.name} == changed
    assert [each.name for each in found if each.group is GAIN] == ["PSC_POSXY_P", "PSC_VELXY_P", "PSC_VELXY_D"]
    assert [each.group for each in found] == sorted((each.group for each in found), key=list(ParameterGroup).index)
    written = ["BARO1_GND_PRESS", "BARO2_GND_PRESS", "COMPASS_DEC", "STAT_FLTTIME", "STAT_RUNTIME"]
    assert [each.name for each in found if each.group is SELF_WRITTEN] == written
    assert [each for each in found if each.group is UNKNOWN] == [ParameterChange("SCR_ENABLE", 0.0, None, UNKNOWN)]
    assert parameter_changes(ARDUPILOT, values[0], values[0]) == []


@pytest.mark.parametrize(
    ("autopilot", "old", "new", "expected"),
    [
        (
            ARDUPILOT,
            {"PSC_ACCZ_P": 0.5, "PSC_POSZ_P": 1.0, "WPNAV_SPEED_UP": 250.0, "PSC_VELZ_P": 5.0, "STAT_BOOTCNT": 3.0},
            {"PSC_D_ACC_P": 0.03, "PSC_D_POS_P": 1.5, "WP_SPD_UP": 3.0, "PSC_D_VEL_P": 5.0, "STAT_BOOTCNT": 4.0},
            [
                ("PSC_D_POS_P", 1.0, 1.5, GAIN),
                ("PSC_D_ACC_P", 0.05, 0.03, GAIN),
                ("WP_SPD_UP", 2.5, 3.0, LOOP),
                ("STAT_BOOTCNT", 3.0, 4.0, SELF_WRITTEN),
            ],
        ),
        (
            ARDUPILOT,
            {"ACCEL_Z_P": 0.5, "POS_Z_P": 1.0, "ACCEL_Z_I": 1.0},
            {"ACCEL_Z_P": 0.4, "POS_Z_P": 2.0, "ACCEL_Z_I": 1.0},
            [("POS_Z_P", 1.0, 2.0, GAIN), ("ACCEL_Z_P", 0.5, 0.4, GAIN)],
        ),
        (
            ARDUPILOT,
            {"PSC_D_ACC_P": 0.02800000086426735, "LOG_BITMASK": 65535.0},
            {"PSC_D_ACC_P": 0.028, "LOG_BITMASK": 176126.0, "RTL_ALT": 1500.0, "PSC_D_POS_P": 1.0},
            [
                ("LOG_BITMASK", 65535.0, 176126.0, OTHER),
                ("PSC_D_POS_P", None, 1.0, UNKNOWN),
                ("RTL_ALT", None, 1500.0, UNKNOWN),
            ],
        ),
        (
            PX4,
            {"MPC_Z_VEL_P": 0.2, "MC_ROLLRATE_P": 0.1, "CAL_ACC0_ID": 76_677_667, "COM_FLIGHT_UUID": 1, "MPC_Z_P": 1.0},
            {"MPC_Z_VEL_P": 0.3, "MC_ROLLRATE_P": 0.2, "CAL_ACC0_ID": 76_677_668, "COM_FLIGHT_UUID": 2, "MPC_Z_P": 1.1},
            [
                ("MPC_Z_P", 1.0, 1.1, GAIN),
                ("MPC_Z_VEL_P", 0.2, 0.3, GAIN),
                ("MC_ROLLRATE_P", 0.1, 0.2, GAIN),
                ("CAL_ACC0_ID", 76_677_667, 76_677_668, OTHER),
                ("COM_FLIGHT_UUID", 1, 2, SELF_WRITTEN),
            ],
        ),
        (PAPARAZZI, {"kd": 82.0, "kp": 283.0}, {"kd": 100.0, "kp": 300.0}, [
            ("kp", 283.0, 300.0, GAIN), ("kd", 82.0, 100.0, GAIN)
        ]),
    ],
)  # fmt: skip
def test_changes_by_the_names_of_the_newer_log_gains_first(
    autopilot: Autopilot,
    old: Mapping[str, float],
    new: Mapping[str, float],
    expected: list[tuple[str, float | None, float | None, ParameterGroup]],
) -> None:
    assert parameter_changes(autopilot, old, new) == [ParameterChange(*each) for each in expected]
