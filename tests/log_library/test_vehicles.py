"""Which vehicle of a log an answer is about, and what kind of vehicle that is."""

from dataclasses import replace

import pytest

from app.core.analysis.analysis import Grade
from app.core.errors import InputError
from app.log_library.content import analyze_content, read_start
from tests.log_library.documents import require_data
from tests.log_library.fleet import CLIMBS, FLEET, HOVERS
from tests.logs.written_tlog import Recording, together

BOTH = {1: "ArduCopter", 7: "ArduCopter"}


def test_of_several_vehicles_the_copter_with_the_most_to_learn_is_analysed_and_all_are_listed() -> None:
    answer = analyze_content(FLEET, None, "fleet.tlog").answer
    assert (answer.vehicle, answer.vehicles, answer.frame) == (1, BOTH, "quadrotor")
    assert answer.tuning.grade is Grade.PARTIAL
    require_data(answer.model_dump(mode="json"))
    answer = analyze_content(together(CLIMBS.content, replace(HOVERS, system=7).content), None, "fleet.tlog").answer
    assert (answer.vehicle, answer.vehicles) == (1, BOTH)


def test_another_one_is_taken_on_request_and_a_kind_without_a_name_is_none() -> None:
    answer = analyze_content(FLEET, None, "fleet.tlog", vehicle=7).answer
    assert (answer.vehicle, answer.vehicles, answer.frame) == (7, BOTH, None)
    assert answer.tuning.grade is Grade.REFUSED
    assert [(each.code, each.named) for each in answer.tuning.reasons] == [("not_a_copter", ["other"])]


@pytest.mark.parametrize(("system", "code"), [(7, "not_a_copter"), (1, "message_missing")])
def test_a_campaign_starts_with_the_vehicle_asked_for(system: int, code: str) -> None:
    with pytest.raises(InputError) as refused:
        read_start(FLEET, None, "fleet.tlog", system)
    assert code in {each.code for each in refused.value.problems}


def test_the_only_vehicle_of_a_log_needs_no_choice() -> None:
    answer = analyze_content(HOVERS.content, None, "one.tlog").answer
    assert (answer.vehicle, answer.vehicles) == (None, {})
    with pytest.raises(InputError, match="vehicle: has no vehicle 3, only 1"):
        analyze_content(HOVERS.content, None, "one.tlog", vehicle=3)


@pytest.mark.parametrize(
    ("log", "frame"),
    [
        (replace(CLIMBS, kind=1), "plane"),
        (replace(CLIMBS, kind=0, parameters={**CLIMBS.parameters, "H_SWASH_TYPE": 1.0}), "helicopter"),
        (replace(CLIMBS, kind=2, parameters={**CLIMBS.parameters, "Q_ENABLE": 1.0}), "VTOL"),
        (replace(CLIMBS, kind=13), "hexarotor"),
        (replace(CLIMBS, kind=0), None),
    ],
)
def test_the_frame_is_in_every_answer_and_refusal(log: Recording, frame: str | None) -> None:
    """By heartbeats or parameters."""
    answer = analyze_content(log.content, None, "flight.tlog").answer
    assert answer.frame == frame
    refused = [each.named for each in answer.tuning.reasons if each.code == "not_a_copter"]
    assert refused == ([[frame]] if frame in ("plane", "helicopter", "VTOL") else [])
