"""`gainline analyze` on logs made of simulated flights: each is answered, or refused for what it lacks.

What a reader or the analysis itself refuses: tests/logs and tests/core/analysis."""

import json
import math
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
from tests.log_library.documents import require_data
from tests.logs.recorded import OnBoardLog
from tests.logs.written import PARAMETERS, STABILIZE, ardupilot_log
from tests.logs.written_px4 import TAKEOFF, px4_log
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


def of_a_helicopter() -> bytes:
    return ardupilot_log(copter(), parameters={**PARAMETERS, "FRAME_CLASS": 6.0})


def manual() -> bytes:
    return ardupilot_log(copter(), modes=((0.0, STABILIZE),))


def unlogged() -> bytes:
    """Without PSCD, as an older release; of CTUN it has no altitude."""
    return ardupilot_log(copter()).replace(b"PSCD", b"XSCD")


@dataclass(frozen=True)
class PoorLog:
    """A log that does not suffice: how much it answers all the same, the code of what was put in, and what is said."""

    name: str
    made: Callable[[], bytes]
    grade: str
    code: str
    said: str


POOR: Final = (
    PoorLog("definitions.bin", lambda: cut(ardupilot_log(copter()), 0.01), "refused", "no_data", "The log has no data"),
    PoorLog("plane.bin", of_a_plane, "refused", "not_a_copter", "The log is that of a plane, not of a copter"),
    PoorLog("helicopter.bin", of_a_helicopter, "refused", "not_a_copter", "The log is that of a helicopter"),
    PoorLog("manual.bin", manual, "partial", "altitude_not_held", "16.9 s (altitude not held)"),
    PoorLog("unlogged.bin", unlogged, "refused", "message_missing", "PSCD is missing."),
    PoorLog("short.bin", lambda: cut(ardupilot_log(copter()), 0.3), "partial", "too_short", "6 s are needed"),
    PoorLog("header.ulg", lambda: px4_log(px4())[:16], "refused", "no_data", "The log has no data: copy the whole log"),
    PoorLog("plane.ulg", lambda: px4_log(px4(), kind=2), "refused", "not_a_copter", "The log is that of a plane"),
    PoorLog(
        "takeoff.ulg",
        lambda: px4_log(px4(), modes=((0.0, TAKEOFF),)),
        "partial",
        "only_takeoffs_or_landings",
        "has too little flight between takeoff and landing",
    ),
    PoorLog(
        "plane.tlog",
        lambda: replace(TLOG, kind=FIXED_WING).content,
        "refused",
        "not_a_copter",
        "The log is that of a plane",
    ),
    PoorLog(
        "hover.tlog",
        lambda: replace(TLOG, set_points=((0.0, 5.0),)).content,
        "partial",
        "no_steps",
        "POSITION_TARGET_LOCAL_NED has no altitude step in GUIDED in flight",
    ),
    PoorLog(
        "loiter.tlog",
        lambda: replace(TLOG, mode=LOITER).content,
        "partial",
        "other_modes",
        "HEARTBEAT has no flight in GUIDED, the mode whose set points the messages give, only in LOITER",
    ),
    PoorLog(
        "hold.tlog",
        lambda: replace(PX4_RECORDING, mode=HOLD).content,
        "partial",
        "other_modes",
        "HEARTBEAT has no flight in Offboard, the mode whose set points the messages give, only in Automatic",
    ),
    PoorLog(
        "unread.tlog",
        lambda: replace(TLOG, parameters={}).content,
        "description",
        "parameter_missing",
        f"PSC_POSZ_P {NEVER_ASKED}",
    ),
    PoorLog(
        "slow.tlog",
        lambda: replace(TLOG, every=12).content,
        "partial",
        "message_rare",
        "NAV_CONTROLLER_OUTPUT arrives 4.2 times a second; 17 times are needed",
    ),
    PoorLog(
        "sideways.tlog",
        lambda: replace(TLOG, lean_rad=0.7).content,
        "partial",
        "leans",
        "The log leans by more than 30° in too much of the flight",
    ),
)


def analyze(tmp_path: Path, name: str, content: bytes, *options: str) -> tuple[int, str]:
    path = tmp_path / name
    path.write_bytes(content)
    result = CliRunner().invoke(app, ["analyze", str(path), *options])
    return result.exit_code, result.output


@pytest.mark.parametrize("log", POOR, ids=lambda log: log.name)
def test_a_log_that_lacks_something_tells_what_it_can_and_names_it(log: PoorLog, tmp_path: Path) -> None:
    out = tmp_path / "answer.json"
    code, output = analyze(tmp_path, log.name, log.made(), "--json", str(out))
    found = json.loads(out.read_text())
    require_data(found)
    is_compared = "signals" in found["replica"]
    assert (code, "Traceback" in output) == (int(log.grade == "refused" and not is_compared), False)
    printed = " ".join(output.split())
    for said in (log.said, *(each["found"] for each in found["texts"]["tuning"]["shapes"])):
        assert said in printed
    frames = {"plane.bin": "plane", "helicopter.bin": "helicopter", "plane.ulg": "plane", "plane.tlog": "plane"}
    assert found["frame"] == frames.get(log.name, "quadrotor" if log.name.endswith(".tlog") else None)
    tuning = found["tuning"]
    assert (tuning["grade"], log.code in {each["code"] for each in tuning["reasons"]}) == (log.grade, True)
    assert (tuning["description"] is None, tuning["numbers"] is None) == (
        log.grade == "refused",
        log.grade in {"refused", "description"},
    )
    if log.grade == "partial":
        lean = 0.7 if log.name == "sideways.tlog" else 0.0
        hover = pytest.approx(0.4 * math.cos(lean), abs=0.02)
        assert tuning["numbers"]["vehicle"]["hover_throttle"] == hover
        assert tuning["numbers"]["assessments"][0]["margin"] > 2.0


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    code, output = analyze(tmp_path, "packed.bin", b"\x1f\x8b\x08")
    assert (code, "file: is compressed (gzip): unpack it first" in output) == (1, True)


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
    found = json.loads(out.read_text())
    require_data(found)
    numbers = found["tuning"]["numbers"]
    vehicle, proposed = numbers["vehicle"], numbers["proposed"]
    assert vehicle["hover_throttle"]["mean"] == pytest.approx(log.hover_throttle, abs=0.005)
    assert vehicle["motor_lag_s"]["mean"] == pytest.approx(log.motor_lag_s, abs=0.03)
    assert {name: proposed["gains"][name] for name in log.gains} == pytest.approx(dict(log.gains))
    assert proposed["error_m"] < 0.75 * numbers["assessments"][0]["error_m"]
    assert proposed["margin"] >= 2.0
