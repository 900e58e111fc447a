"""A campaign that starts from the log of another flight: what the log tells holds until the first flight."""

from dataclasses import replace

import pytest

from app.autopilots.ardupilot.experiments import ArduPilotLoop, ardupilot_loop
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.ardupilot.replica.vertical import packed
from app.autopilots.px4.experiments import Px4Loop, px4_loop
from app.autopilots.px4.replica.parameters import Parameters as Px4Parameters
from app.autopilots.registry import evidence_of, experiment_of
from app.core.definition import Definition, LogEvidence, Start
from app.core.experiments.base import prior_distribution
from app.core.tuning.gate import check_policy
from tests.core.tuning.defined import next_proposal, problems_of

VEHICLE = {
    "hover_throttle": (0.6, 0.002),
    "thrust_slope": (1.0, 0.02),
    "motor_lag_s": (0.05, 0.01),
    "drag_1_s": (0.3, 0.05),
}
LOG = LogEvidence(file_name="day.tlog", error_m=0.0411, vehicle=VEHICLE, parameters={"WPNAV_SPEED_UP": 150.0})
FIRM = {"PSC_POSZ_P": 3.0, "PSC_VELZ_P": 8.0, "PSC_ACCZ_P": 1.41, "PSC_ACCZ_I": 3.0, "PSC_ACCZ_D": 0.0}
WITH_LOG = Definition(
    experiment="altitude-steps-ardupilot", strategy="calibrated", start=Start(kind="given", gains=FIRM, log=LOG)
)
WITHOUT = replace(WITH_LOG, start=Start(kind="given", gains=FIRM))


def refused_by(definition: Definition) -> list[str]:
    gate = check_policy(evidence_of(definition, []), FIRM)
    return [check.name for check in gate.refusals]


def test_the_vehicle_of_the_log_is_the_one_that_the_gate_simulates() -> None:
    known = prior_distribution(experiment_of(WITH_LOG))
    assert known.mean == pytest.approx([mean for mean, _ in VEHICLE.values()])
    assert known.covariance[0][0] == pytest.approx(0.002**2)
    assert refused_by(WITH_LOG) == []
    assert refused_by(WITHOUT) == ["margin"]


def test_the_first_flight_has_the_gains_of_the_log_and_its_error_is_not_compared() -> None:
    proposal = next_proposal(WITH_LOG, [])
    assert (proposal.kind, proposal.gains) == ("start", FIRM)
    assert "uses the gains proposed from day.tlog" in proposal.explanation.summary
    assert "deviated by 41.1 mm from its reference" in proposal.explanation.notes[0]
    assert "not compared with it" in proposal.explanation.notes[0]
    assert "given in the campaign's definition" in next_proposal(WITHOUT, []).explanation.summary


def test_a_log_belongs_to_the_digest() -> None:
    other = replace(LOG, error_m=0.04)
    with_other = replace(WITH_LOG, start=replace(WITH_LOG.start, log=other))
    assert len({WITH_LOG.digest(), WITHOUT.digest(), with_other.digest()}) == 3


@pytest.mark.parametrize(
    ("log", "field"),
    [
        (replace(LOG, vehicle={}), "start.log.vehicle"),
        (replace(LOG, vehicle={**VEHICLE, "motor_lag_s": (0.05, -0.01)}), "start.log.vehicle.motor_lag_s"),
        (replace(LOG, vehicle={**VEHICLE, "motor_lag_s": (0.05, 1e200)}), "start.log.vehicle.motor_lag_s"),
        (replace(LOG, vehicle={**VEHICLE, "drag_1_s": (float("nan"), 0.1)}), "start.log.vehicle.drag_1_s"),
        (replace(LOG, parameters={"PSC_ACCZ_NTF": 1.0}), "start.log.parameters.PSC_ACCZ_NTF"),
    ],
)
def test_a_log_that_cannot_be_is_refused(log: LogEvidence, field: str) -> None:
    definition = replace(WITH_LOG, start=Start(kind="given", gains=FIRM, log=log))
    assert [problem.field for problem in problems_of(definition)] == [field]


def test_a_log_goes_with_its_gains_and_with_altitude_steps_of_copters_only() -> None:
    assert problems_of(WITH_LOG) == ()
    for definition in (
        replace(WITH_LOG, start=Start(log=LOG)),
        Definition(strategy="calibrated", start=Start(kind="given", gains={"kp": 283, "ki": 13, "kd": 82}, log=LOG)),
    ):
        assert [problem.field for problem in problems_of(definition)] == ["start.log"]


def test_the_parameters_of_a_loop_describe_it() -> None:
    ardupilot = ArduPilotLoop(
        parameters=Parameters(climb_m_s=1.5, acceleration_p=0.7, hover_throttle=0.2), filter_hz=10.0, step_s=1 / 300
    )
    found = ardupilot_loop(ardupilot.firmware_parameters)
    assert (found.step_s, found.filter_hz) == pytest.approx((1 / 300, 10.0))
    assert packed(found.parameters) == pytest.approx(packed(ardupilot.parameters))
    px4 = Px4Loop(parameters=Px4Parameters(climb_m_s=1.2), step_s=0.004, row_s=0.1, descent_m_s=1.0)
    again = px4_loop(px4.firmware_parameters)
    assert again.step_s == pytest.approx(0.004)
    assert again.parameters == px4.parameters
