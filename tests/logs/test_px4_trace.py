import io
import json

import numpy as np
import pytest

from app.autopilots.px4.replica.parameters import Parameters
from app.autopilots.px4.replica.replay import LoopTrace
from app.autopilots.px4.replica.vertical import INPUTS, OUTPUTS
from app.autopilots.px4.replica_check import COLUMNS, read_px4_trace
from app.core.errors import InputError
from app.logs.trace_table import has_columns

DESCRIPTION = {"what": "a hover", "parameters": {"MPC_Z_P": 1.5, "SIH_MASS": 1.0}}
ROW = {
    "time_s": "0", "dt_s": "0.008", "z_m": "-3", "vz_m_s": "0.1", "set_z_m": "-3.5", "set_vz_m_s": "",
    "set_az_m_s2": "", "hover_estimate": "", "armed": "1", "landed": "0", "ground_contact": "0", "want_takeoff": "0",
    "limit_up_m_s": "3", "limit_down_m_s": "1.5", "takeoff_state": "5", "out_vz_m_s": "-0.5", "out_az_m_s2": "-2.4",
    "out_thrust": "0.6",
}  # fmt: skip


def content(*changes: dict[str, str], **described: object) -> bytes:
    """A run with one row per argument, each the usual row with these changes; columns may be added by all."""
    rows = [ROW | change for change in changes or ({},)]
    lines = [",".join(rows[0]), *(",".join(row.values()) for row in rows)]
    return "\n".join([f"# {json.dumps(DESCRIPTION | described)}", *lines, ""]).encode()


def read(text: bytes) -> LoopTrace:
    return read_px4_trace(io.BytesIO(text), name="run.csv")


def column(trace: LoopTrace, name: str) -> list[float]:
    return [float(value) for value in trace.inputs[:, INPUTS.index(name)]]


def test_parameters_inputs_and_outputs_are_read() -> None:
    trace = read(content())
    assert trace.parameters == Parameters(position_p_1_s=1.5)
    assert (trace.filter_sample_s, trace.flown) == (0.008, False)
    assert column(trace, "set_z_m") == [-3.5]
    assert np.isnan(column(trace, "set_vz_m_s")).all()
    assert trace.outputs[0, :4].tolist() == [5.0, -0.5, -2.4, 0.6]
    assert np.isnan(trace.outputs[0, 4:]).all()
    assert len(OUTPUTS) == 6


def test_recorded_filter_interval_and_further_outputs_are_read() -> None:
    trace = read(content({"ramp_m_s": "3", "out_vz_derivative": "0.2"}, filter_sample_s=0.01))
    assert trace.filter_sample_s == 0.01
    assert trace.outputs[0, 4:].tolist() == [3.0, 0.2]


def test_the_slope_of_altitude_is_its_difference_unless_recorded() -> None:
    slope = "z_derivative_m_s"
    assert column(read(content({}, {"z_m": "-2.992"})), slope) == pytest.approx([0.0, 1.0])
    assert column(read(content({slope: "0.3"})), slope) == [0.3]


def test_set_points_of_a_flight_are_new_where_they_change_and_in_offboard_control_always() -> None:
    rows = [{}, {}, {"set_z_m": "-3.6"}, {"set_z_m": "-3.6", "set_vz_m_s": "0"}, {"set_z_m": "-3.6", "set_vz_m_s": "0"}]
    auto = [row | {"offboard": "0"} for row in rows]
    trace = read(content(*auto))
    assert trace.flown
    assert column(trace, "set_new") == [1.0, 0.0, 1.0, 1.0, 0.0]
    assert column(read(content(*(row | {"offboard": "1"} for row in rows))), "set_new") == [1.0] * 5
    assert column(read(content(*rows)), "set_new") == [1.0] * 5


def test_flags_of_a_flight_and_set_points_of_offboard_control_may_have_been_read_one_row_later() -> None:
    """Set-points of auto modes are computed from the estimate of the row."""
    rows = [
        {"offboard": "0"},
        {"offboard": "0", "landed": "1", "want_takeoff": "1", "set_z_m": "-3.6"},
        {"offboard": "1", "set_z_m": "-3.7", "limit_up_m_s": "2"},
    ]
    trace = read(content(*rows))
    late = {name: trace.late_inputs[:, place].tolist() for place, name in enumerate(INPUTS)}
    assert late["landed"] == [0.0, 0.0, 1.0]
    assert late["set_z_m"] == [-3.5, -3.6, -3.6]
    unchanged = [name for name in INPUTS if name not in ("landed", "set_z_m")]
    assert all(np.array_equal(late[name], column(trace, name), equal_nan=True) for name in unchanged)


def test_of_the_loop_alone_the_recording_tells_when_it_read_what() -> None:
    trace = read(content({}, {"landed": "1", "set_z_m": "-3.6"}))
    assert np.array_equal(trace.late_inputs, trace.inputs, equal_nan=True)


def test_a_trace_is_recognised_by_its_columns() -> None:
    assert has_columns(content(), COLUMNS)
    assert not has_columns(content().replace(b"out_thrust", b"thrust"), COLUMNS)
    assert set(ROW) == set(COLUMNS)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (content(parameters=[1]), "line 1, parameters: must be a JSON object"),
        (content(parameters={"MPC_Z_P": True}), "line 1, MPC_Z_P: must be a finite number"),
        (content(parameters={"MPC_Z_P": -1}), "MPC_Z_P: must be at least 0"),
        (content(filter_sample_s="fast"), "line 1, filter_sample_s: must be a finite number"),
        (content(filter_sample_s=0), "line 1, filter_sample_s: must be positive"),
        (content({}, {"dt_s": "0"}), "line 4, dt_s: must be positive"),
        (content({"armed": "2"}), "line 3, armed: must be 0 or 1"),
        (content({"z_m": ""}), "line 3, z_m: must be a finite number"),
    ],
)
def test_what_is_missing_or_wrong_is_named(text: bytes, problem: str) -> None:
    with pytest.raises(InputError) as refusal:
        read(text)
    assert problem in str(refusal.value)
