"""The replica against PX4's flights as a log holds them: recorded at every position, with one row in twelve (10 Hz)."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.autopilots.px4.replica.replay import LoopLog, replica_of
from app.autopilots.px4.replica.vertical import FLIGHT, INPUTS, OUTPUTS
from app.autopilots.px4.replica_check import read_px4_trace
from app.core.records.trajectory import Samples

FLIGHTS = Path(__file__).parents[3] / "data" / "px4_loop"
EVERY = 12


def logged(name: str) -> LoopLog:
    with (FLIGHTS / f"{name}.csv.gz").open("rb") as stream:
        trace = read_px4_trace(stream, name=name)
    given = dict(zip(INPUTS, trace.inputs.T, strict=True)) | dict(zip(OUTPUTS, trace.outputs.T, strict=True))
    place = np.flatnonzero(given["takeoff_state"] == FLIGHT)[::EVERY]
    row = {each: values[place] for each, values in given.items()}
    return LoopLog(
        parameters=trace.parameters,
        time_s=trace.time_s,
        z_m=given["z_m"],
        vz_m_s=given["vz_m_s"],
        z_derivative_m_s=given["z_derivative_m_s"],
        place=place,
        flying=~(row["ground_contact"] > 0.0),
        set_z_m=row["set_z_m"],
        set_vz_m_s=row["set_vz_m_s"],
        set_az_m_s2=row["set_az_m_s2"],
        known=np.ones(len(place), dtype=np.bool_),
        limit_up_m_s=row["limit_up_m_s"],
        limit_down_m_s=row["limit_down_m_s"],
        hover=in_force(given["hover_estimate"], trace.parameters.hover_thrust)[place],
        out_vz_m_s=row["out_vz_m_s"],
        out_az_m_s2=row["out_az_m_s2"],
        out_thrust=row["out_thrust"],
    )


def in_force(estimates: Samples, before: float) -> Samples:
    """The last estimate that was given, shape (n,)."""
    last = np.maximum.accumulate(np.where(np.isnan(estimates), -1, np.arange(len(estimates))))
    return np.where(last >= 0, estimates[last], before)


def differences(log: LoopLog) -> dict[str, NDArray[np.float64]]:
    replica = replica_of(log)
    assert tuple(replica) == ("out_vz_m_s", "out_az_m_s2", "out_thrust")
    return {name: np.abs(values - getattr(log, name)) for name, values in replica.items()}


@pytest.mark.parametrize("name", ["default_steps_push", "stiff_steps_push"])
def test_the_rows_of_a_flight_follow_from_each_other(name: str) -> None:
    """To seven digits within a row, and to 0.001 m/s² through twelve positions; single rows are undecided, where a
    limit was active between two rows or messages share a time stamp."""
    log = logged(name)
    apart = differences(log)
    allowed = {"out_vz_m_s": 2e-7, "out_thrust": 1e-7, "out_az_m_s2": 1e-3}
    for signal, limit in allowed.items():
        compared = apart[signal][np.isfinite(apart[signal])]
        assert len(compared) > 0.5 * len(log.place)
        assert np.median(compared) < 0.1 * limit
        assert np.quantile(compared, 0.95) < limit


def test_the_push_is_among_the_rows_that_were_computed() -> None:
    log = logged("default_steps_push")
    pushed = np.isfinite(replica_of(log)["out_az_m_s2"]) & (log.set_az_m_s2 == 2.0)
    assert pushed.sum() > 50


@pytest.mark.parametrize(
    ("parameter", "value", "signal"),
    [
        ("position_p_1_s", 1.02, "out_vz_m_s"),
        ("velocity_p_1_s", 4.1, "out_az_m_s2"),
        ("velocity_i_1_s2", 2.2, "out_az_m_s2"),
        ("velocity_d", 0.1, "out_az_m_s2"),
    ],
)
def test_another_gain_than_flown_is_found(parameter: str, value: float, signal: str) -> None:
    log = logged("default_steps_push")
    other = replace(log, parameters=replace(log.parameters, **{parameter: value}))
    flown, changed = (np.nanmedian(differences(each)[signal]) for each in (log, other))
    assert changed > 30 * flown


def test_what_is_not_known_is_not_computed() -> None:
    """Set-points between the messages that were logged, hover thrust between its estimates, and a gap of positions."""
    log = logged("default_steps_push")
    replica = replica_of(log)
    row = int(np.flatnonzero(np.isfinite(replica["out_az_m_s2"]))[10])
    unknown = log.known.copy()
    unknown[row] = False
    found = replica_of(replace(log, known=unknown))
    assert np.isnan([found["out_vz_m_s"][row], *found["out_az_m_s2"][row : row + 2]]).all()
    assert np.isfinite(found["out_thrust"][row])

    hover = log.hover.copy()
    hover[row] = np.nan
    found = replica_of(replace(log, hover=hover))
    assert np.isnan([found["out_thrust"][row], *found["out_az_m_s2"][row : row + 2]]).all()
    assert np.isfinite(found["out_vz_m_s"][row])

    time_s = log.time_s.copy()
    time_s[log.place[row] :] += 0.1
    found = replica_of(replace(log, time_s=time_s))
    assert np.isnan(found["out_az_m_s2"][row])
    assert found["out_az_m_s2"][row + 2] == replica["out_az_m_s2"][row + 2]


def test_a_single_row_has_none_before_it() -> None:
    log = logged("default_steps_push")
    rows = {each.name: getattr(log, each.name) for each in fields(log)}
    single = replace(log, **{name: rows[name][:1] for name in rows if np.shape(rows[name]) == log.place.shape})
    found, of_all = replica_of(single), replica_of(log)
    assert np.isnan(found["out_az_m_s2"]).all()
    assert found["out_vz_m_s"].tolist() == of_all["out_vz_m_s"][:1].tolist()
    assert found["out_thrust"].tolist() == of_all["out_thrust"][:1].tolist()
