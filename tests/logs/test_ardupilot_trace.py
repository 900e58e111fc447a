import io
import json

import pytest

from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.ardupilot.replica.replay import Hover, LoopTrace
from app.autopilots.ardupilot.replica_check import COLUMNS, read_ardupilot_trace
from app.core.errors import InputError
from app.logs.trace_table import has_columns

HOVER = {"z_m": 6.0, "v_m_s": 0.1, "a_m_s2": -0.2, "throttle": 0.39}
DESCRIPTION = {
    "dt_s": 0.0025,
    "start": "hover",
    "init": HOVER,
    "TKOFF_SLEW_TIME": None,
    "params": {"PSC_POSZ_P": 2, "WPNAV_SPEED_UP_m_s": 3.0, "WPNAV_SPEED_DN": 120.0},
}
ROW = "0,6,6.1,0.2,0.3,0,1,6.2,0.4,0.5,0.6,0.7,-60,0.38,0.39"


def content(*, row: str = ROW, without: str = "", **changes: object) -> bytes:
    described = {key: value for key, value in (DESCRIPTION | changes).items() if key != without}
    return f"# {json.dumps(described)}\n{','.join(COLUMNS)}\n{row}\n".encode()


def read(text: bytes) -> LoopTrace:
    return read_ardupilot_trace(io.BytesIO(text), name="run.csv")


def test_parameters_start_inputs_and_outputs_are_read() -> None:
    trace = read(content())
    assert trace.parameters == Parameters(position_p_1_s=2.0, climb_m_s=3.0, descent_m_s=1.2)
    assert (trace.dt_s, trace.hover) == (0.0025, Hover(throttle=0.39, z_m=6.0, v_m_s=0.1, a_m_s2=-0.2))
    assert trace.time_s.tolist() == [0.0]
    assert trace.inputs.tolist() == [[6.0, 6.1, 0.2, 0.3, 0.0, 1.0]]
    assert trace.outputs.tolist() == [[6.2, 0.4, 0.5, 0.6, 0.7, -60.0, 0.38, 0.39]]


def test_a_takeoff_has_its_slew_time_and_no_hover() -> None:
    trace = read(content(start="ramp from the ground", init=None, TKOFF_SLEW_TIME=1.5, TKOFF_THR_MAX=0.8))
    assert trace.hover is None
    assert trace.parameters.takeoff_slew_s == 1.5
    assert trace.parameters.takeoff_throttle == 0.8


def test_a_trace_is_recognised_by_its_columns() -> None:
    assert has_columns(content(), COLUMNS)
    assert not has_columns(content().replace(b"a_t_m_s2", b"thrust"), COLUMNS)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (content(without="params"), "line 1, params: must be a JSON object"),
        (content(params={"PSC_POSZ_P": "2"}), "line 1, PSC_POSZ_P: must be a finite number"),
        (content(params={"PSC_POSZ_P": True}), "line 1, PSC_POSZ_P: must be a finite number"),
        (content(params={"PSC_POSZ_P": -2}), "PSC_POSZ_P: must be positive"),
        (content(without="dt_s"), "line 1, dt_s: must be a finite number"),
        (content(dt_s=0), "line 1, dt_s: must be positive"),
        (content(start="landed"), "line 1, start: must be hover or ramp, got 'landed'"),
        (content(init=None), "line 1, init: must be a JSON object"),
        (content(init={"z_m": 6.0}), "line 1, v_m_s: must be a finite number"),
        (content(row=ROW.replace(",0,1,", ",0.5,1,")), "line 3, limit_lower: must be 0 or 1"),
        (content(row=ROW.replace(",0,1,", ",0,2,")), "line 3, limit_upper: must be 0 or 1"),
        (content(row=ROW.replace("-60", "")), "line 3, i_term_permille: must be a finite number, got ''"),
    ],
)
def test_what_is_missing_or_wrong_is_named(text: bytes, problem: str) -> None:
    with pytest.raises(InputError) as refusal:
        read(text)
    assert problem in str(refusal.value)
