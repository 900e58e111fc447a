"""A takeoff in a log of the new format, which is recognised by what the file begins with."""

from io import BytesIO

import numpy as np
import pytest

from app.autopilots.log_readers import read_takeoff
from app.core.errors import TrajectoryError

TIME_S = np.arange(0.0, 40.0, 0.02)
ALTITUDE_CM = np.where(TIME_S < 5.0, 0.0, 300.0 * -np.expm1(5.0 - TIME_S))
ROWS = [f"{1e6 * t:.0f} {height:.3f} {t > 5.0:d} 283" for t, height in zip(TIME_S, ALTITUDE_CM, strict=True)]
LOG = "\n".join(["#TEXTLOG", *ROWS]).encode()


def test_its_takeoff_is_read_with_the_gains() -> None:
    takeoff = read_takeoff(BytesIO(LOG), name="flight.txt")
    assert takeoff.start_s == pytest.approx(5.02)
    assert takeoff.trajectory["altitude_m"][-1] == pytest.approx(3.0, abs=0.001)
    assert takeoff.gains == {"kp": 283.0, "ki": 283.0, "kd": 283.0}


def test_a_damaged_one_is_refused_with_the_reason() -> None:
    with pytest.raises(TrajectoryError) as refusal:
        read_takeoff(BytesIO(LOG + b"\nthree words only"), name="flight.txt")
    assert refusal.value.problems[0].reason == "contains a row that is not four numbers"
