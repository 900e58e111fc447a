"""ArduPilot's logs as records of the vertical loop, from the log of the real binary as it is and with parts renamed."""

import io
from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.ardupilot.replica.replay import LoopLog
from app.autopilots.ardupilot.replica_check import ardupilot_loop_log
from app.autopilots.frames import frame_of
from app.core.errors import InputError
from tests.logs.recorded import OnBoardLog, recorded

LOG = recorded("arducopter_steps.bin")


def read(*renamed: tuple[bytes, bytes]) -> LoopLog:
    content = LOG
    for name, other in renamed:
        assert len(name) == len(other)
        content = content.replace(name, other)
    return ardupilot_loop_log(read_ardupilot(io.BytesIO(content)), name="flight.bin")


def test_rows_parameters_and_targets_are_those_of_the_flight() -> None:
    """GUIDED until 68.677 s; the controllers fly from 44.9 s on. The mean error of the steps is known: 27.5 mm."""
    log = read()
    assert (log.parameters.hover_throttle, log.parameters.takeoff_throttle) == pytest.approx((0.39, 0.9))
    assert replace(log.parameters, hover_throttle=0.35, takeoff_throttle=0.9) == Parameters()
    assert log.rate_hz == 400.0
    assert (log.time_s[0], log.time_s[-1]) == pytest.approx((44.95, 68.63), abs=0.06)
    flown = (log.time_s >= 55.642) & (log.time_s < 68.642)
    assert np.abs(log.z_d_m - log.z_m)[flown].mean() == pytest.approx(0.0275, abs=1e-4)
    assert np.isfinite(log.throttle).all()
    assert log.targets == ((52.632272, 5.0), (55.641901, 7.0), (62.136802, 5.0))
    assert not log.limited.any()


@pytest.mark.parametrize(
    "renamed",
    [
        [(b"GUIP", b"XUIP")],
        [(b"pX,pY,pZ,Terrain,vX", b"vX,pY,pZ,Terrain,pX")],
        [(b"GUID_OPTIONS", b"XUID_OPTIONS"), (b"WPNAV_RADIUS", b"GUID_OPTIONS")],
    ],
    ids=["not logged", "with a velocity", "planned by waypoint navigation"],
)
def test_targets_that_the_shaper_does_not_follow_alone_are_left_out(renamed: list[tuple[bytes, bytes]]) -> None:
    assert read(*renamed).targets == ()


def test_terms_that_are_not_logged_are_nan() -> None:
    log = read((b"PIDA", b"XIDA"))
    assert np.isnan(log.control_per_mille).all()
    assert np.isfinite(log.throttle).all()
    assert np.isnan(read((b",DFF", b",XFF")).control_per_mille).all()


def test_a_loop_rate_that_cannot_be_is_the_default() -> None:
    assert read((b"SCHED_LOOP_RATE", b"XCHED_LOOP_RATE")).rate_hz == 400.0
    assert read((b"SCHED_LOOP_RATE", b"XCHED_LOOP_RATE"), (b"GUID_TIMEOUT\0\0\0", b"SCHED_LOOP_RATE")).rate_hz == 400.0


@pytest.mark.parametrize(
    ("renamed", "problem"),
    [
        ([(b"PSCD", b"XSCD")], "PSCD: is missing"),
        ([(b",TVD", b",XVD")], "PSCD: is missing"),
        ([(b"MODE", b"XODE")], "PSCD: has no row in flight in GUIDED"),
        ([(b"PARM", b"XARM")], "PSC_POSZ_P: is missing"),
        ([(b"PSC_POSZ_P", b"PSC_D_POS_")], "PSC_POSZ_P: is missing"),
        ([(b"PSC_ACCZ_SMAX", b"XSC_ACCZ_SMAX"), (b"WPNAV_RADIUS\0", b"PSC_ACCZ_SMAX")], "PSC_ACCZ_SMAX: must be 0"),
    ],
)
def test_a_log_that_cannot_be_compared_is_refused_by_what_is_missing(
    renamed: list[tuple[bytes, bytes]], problem: str
) -> None:
    with pytest.raises(InputError) as refusal:
        read(*renamed)
    assert problem in str(refusal.value)


@pytest.mark.parametrize(
    ("banner", "firmware", "release", "frame"),
    [
        (b"ArduCopter V4.5.7 (0358a9c2)", "", "4.5.7", ""),
        (b"ArduCopter V4.1.0-dev (0b517cfc)", "", "4.1.0-dev", ""),
        (b"APM:Copter V3.4.4-rc1 (c0ffee00)", "", "3.4.4-rc1", ""),
        (b"ArduPlane V4.5.7 (0358a9c2)", "ArduPlane", "4.5.7", "plane"),
        (b"Frame: QUAD", "", "", "QUAD"),
        (b"Frame: QUAD/X", "", "", "QUAD/X"),
        (b"Frame: HELI", "", "", "helicopter"),
        (b"Framing", "", "", ""),
    ],
)
def test_firmware_release_and_frame_are_those_that_it_tells(
    banner: bytes, firmware: str, release: str, frame: str
) -> None:
    log = OnBoardLog()
    log.define(1, "MSG", "QZ", "TimeUS,Message")
    for message in (b"RC Protocol: SITL", banner):
        log.add(1, "<Q64s", 0, message)
    found = read_ardupilot(io.BytesIO(log.content))
    assert (found.firmware, found.release, frame_of(found)) == (firmware, release, frame)
