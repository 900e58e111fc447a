"""`gainline analyze` on logs made of simulated flights: each is answered, or refused for what it lacks.

What a reader or the analysis itself refuses: tests/logs and tests/core/analysis."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Final

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from tests.core.analysis.flights import QUIET, simulated_flight
from tests.core.analysis.px4_flights import simulated_px4
from tests.logs.recorded import OnBoardLog
from tests.logs.written import ardupilot_log
from tests.logs.written_px4 import px4_log
from tests.logs.written_tlog import (
    HOLD,
    LOITER,
    PX4_RECORDING,
    Recording,
)

copter = cache(simulated_flight)
px4 = cache(simulated_px4)
TLOG: Final = Recording()
FIXED_WING: Final = 1
NEVER_ASKED: Final = "is not in the log, nor is PSC_D_POS_P: read the vehicle's parameters"


def cut(content: bytes, share: float = 0.6) -> bytes:
    """The log up to the middle of a record."""
    return content[: int(share * len(content)) + 4]


def of_a_plane() -> bytes:
    log = OnBoardLog()
    log.define(1, "MSG", "QZ", "TimeUS,Message")
    log.add(1, "<Q64s", 0, b"ArduPlane V4.5.7 (0358a9c2)")
    return log.content


@dataclass(frozen=True)
class RefusedLog:
    name: str
    made: Callable[[], bytes]
    said: str


REFUSED: Final = (
    RefusedLog("packed.bin", lambda: b"\x1f\x8b\x08", "file: is compressed (gzip): unpack it first"),
    RefusedLog("definitions.bin", lambda: cut(ardupilot_log(copter()), 0.01), "file: has no data: copy the whole log"),
    RefusedLog("plane.bin", of_a_plane, "file: is that of a plane, not of a copter with several rotors"),
    RefusedLog("header.ulg", lambda: px4_log(px4())[:16], "file: has no data: copy the whole log"),
    RefusedLog(
        "plane.ulg",
        lambda: px4_log(px4(), without=("takeoff_status",), kind=2),
        "file: is that of a plane",
    ),
    RefusedLog("plane.tlog", lambda: replace(TLOG, kind=FIXED_WING).content, "file: is that of a plane"),
    RefusedLog(
        "hover.tlog",
        lambda: replace(TLOG, set_points=((0.0, 5.0),)).content,
        "POSITION_TARGET_LOCAL_NED: has no altitude step in GUIDED in flight",
    ),
    RefusedLog(
        "loiter.tlog",
        lambda: replace(TLOG, mode=LOITER).content,
        "HEARTBEAT: has no flight in the one mode whose set points the messages give: needed and flown, GUIDED, LOITER",
    ),
    RefusedLog("hold.tlog", lambda: replace(PX4_RECORDING, mode=HOLD).content, "needed and flown, Offboard, Automatic"),
    RefusedLog("unread.tlog", lambda: replace(TLOG, parameters={}).content, f"PSC_POSZ_P: {NEVER_ASKED}"),
    RefusedLog(
        "slow.tlog",
        lambda: replace(TLOG, every=12).content,
        "NAV_CONTROLLER_OUTPUT: arrives 4.2 times a second; 17 times are needed",
    ),
    RefusedLog(
        "sideways.tlog",
        lambda: replace(TLOG, lean_rad=0.7).content,
        "ATTITUDE_TARGET: leans by more than 30° in too much of the flight",
    ),
)


def analyze(tmp_path: Path, name: str, content: bytes, *options: str) -> tuple[int, str]:
    path = tmp_path / name
    path.write_bytes(content)
    result = CliRunner().invoke(app, ["analyze", str(path), *options])
    return result.exit_code, result.output


@pytest.mark.parametrize("log", REFUSED, ids=lambda log: log.name)
def test_a_log_that_lacks_something_is_refused_by_naming_it(log: RefusedLog, tmp_path: Path) -> None:
    code, output = analyze(tmp_path, log.name, log.made())
    assert (code, "Traceback" in output) == (1, False)
    assert log.said in " ".join(output.split())


@dataclass(frozen=True)
class UsedLog:
    """`hover_throttle` and `motor_lag_s` are those of the simulated vehicle."""

    name: str
    made: Callable[[], bytes]
    hover_throttle: float
    motor_lag_s: float
    gains: Mapping[str, float]


USED: Final = (
    UsedLog("steps.tlog", lambda: TLOG.content, 0.4, 0.05, {"PSC_POSZ_P": 3.0, "PSC_VELZ_P": 8.0}),
    pytest.param(
        UsedLog("steps.tlog", lambda: PX4_RECORDING.content, 0.4, 0.05, {"MPC_Z_P": 1.5}), marks=pytest.mark.complete
    ),
    pytest.param(
        UsedLog("cut.tlog", lambda: cut(TLOG.content), 0.4, 0.05, {"PSC_POSZ_P": 3.0}), marks=pytest.mark.complete
    ),
    pytest.param(
        UsedLog("cut.bin", lambda: cut(ardupilot_log(copter(QUIET))), 0.4, 0.05, {"PSC_POSZ_P": 3.0}),
        marks=pytest.mark.complete,
    ),
    pytest.param(
        UsedLog("cut.ulg", lambda: cut(px4_log(px4())), 0.4, 0.05, {"MPC_Z_P": 1.5}), marks=pytest.mark.complete
    ),
)


@pytest.mark.complete
@pytest.mark.parametrize("log", USED, ids=lambda log: log.name)
def test_a_log_that_suffices_gives_the_vehicle_and_gains_for_it(log: UsedLog, tmp_path: Path) -> None:
    out = tmp_path / "answer.json"
    code, output = analyze(tmp_path, log.name, log.made(), "--json", str(out))
    assert code == 0, output
    numbers = json.loads(out.read_text())["tuning"]["numbers"]
    vehicle, proposed = numbers["vehicle"], numbers["proposed"]
    assert vehicle["hover_throttle"]["mean"] == pytest.approx(log.hover_throttle, abs=0.005)
    assert vehicle["motor_lag_s"]["mean"] == pytest.approx(log.motor_lag_s, abs=0.03)
    assert {name: proposed["gains"][name] for name in log.gains} == pytest.approx(dict(log.gains))
    assert proposed["error_m"] < 0.75 * numbers["assessments"][0]["error_m"]
    assert proposed["margin"] >= 2.0
