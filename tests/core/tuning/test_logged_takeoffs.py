"""Analyses of logged takeoffs: of Paparazzi's own records, and of takeoffs that its exact replica flies on a point mass
with instant thrust."""

from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

from app.autopilots.log_readers import read_takeoff
from app.core.errors import TrajectoryError
from app.core.experiments.takeoff import Takeoff
from app.core.statistics.gain_change import compare_takeoffs
from app.core.tuning.logged_takeoffs import LoggedTakeoff, analyze_takeoffs, score_takeoffs
from tests.core.tuning.flying import compiled_only
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.logs.recorded import recorded

pytestmark = compiled_only

DEFAULT = {"kp": 283, "ki": 13, "kd": 82}


def flown(gains: Mapping[str, float], *, number: int = 1, fly_s: float = 34.0) -> LoggedTakeoff:
    """A takeoff with these gains, by the replica on a point mass."""
    whole = {name: int(value) for name, value in gains.items()}
    data = data_of(Flight(gains=whole, every=10, fly_s=fly_s, setting=True)).encode()
    record = read_takeoff(BytesIO(data), companion=BytesIO(COMPANION.encode())).trajectory
    return LoggedTakeoff(number=number, gains=dict(gains), trajectory=record)


def from_log(name: str) -> LoggedTakeoff:
    found = read_takeoff(BytesIO(recorded(name)))
    return LoggedTakeoff(number=found.number, gains=found.gains, trajectory=found.trajectory)


def reason_of(refused: pytest.ExceptionInfo[TrajectoryError]) -> str:
    return refused.value.problems[0].reason


def test_one_takeoff_gives_gains_that_fly_as_predicted() -> None:
    found = analyze_takeoffs([flown(DEFAULT)])
    assert found.proposed is not None
    again = Takeoff().error(flown(found.proposed.gains).trajectory)
    assert found.proposed.interval.lower <= again <= found.proposed.interval.upper
    assert again < 0.5 * (found.best.error or 0.0)


def test_the_recorded_takeoff_with_the_default_gains_finds_much_better_ones() -> None:
    """Second flights of the real autopilot scored 0.091 to 0.098 m, and its takeoff with the default gains 0.330 m."""
    found = analyze_takeoffs([from_log("paparazzi_283_13_82.tlog")])
    assert found.best.error == pytest.approx(0.330, abs=0.002)
    assert found.proposed is not None
    assert 0.085 < found.proposed.predicted_error_m < 0.105
    assert found.proposed.refusal == ""
    assert found.answer.startswith("Mean distance from 3 m: 0.330 m measured. The model predicts 0.09")
    hover = next(each for each in found.fitted if each.name == "hover_throttle")
    assert hover.value == pytest.approx(0.63, abs=0.01)


def test_gains_that_can_overflow_are_replaced_even_by_equally_good_ones() -> None:
    """ki 1356 can overflow the integrator's product; gains without that fly as well."""
    found = analyze_takeoffs([from_log("paparazzi_1624_1356_195.tlog")])
    assert "overflow 32 bits" in found.assessments[0].refusal
    assert found.proposed is not None
    assert found.proposed.refusal == ""
    assert found.proposed.gains["ki"] <= 1073
    assert found.answer.endswith("for the proposed gains. The gate refuses the gains flown.")


@pytest.mark.complete
def test_gains_that_are_already_good_are_kept() -> None:
    first = analyze_takeoffs([flown(DEFAULT)])
    assert first.proposed is not None
    again = analyze_takeoffs([flown(first.proposed.gains)])
    assert again.proposed is None
    assert again.answer == "Keep the gains flown: no other gains are predicted to reduce the error by more than 5 %."


def test_all_takeoffs_of_a_log_count_over_the_shortest_of_them() -> None:
    better = {"kp": 900, "ki": 300, "kd": 120}
    found = analyze_takeoffs([flown(DEFAULT), flown(better, number=2, fly_s=20.0), flown(DEFAULT, number=3, fly_s=6.0)])
    assert found.window_s == pytest.approx(20.0, abs=0.2)
    assert list(found.numbers) == [1, 2]
    assert found.best.number == 2
    assert [(each.name, dict(each.gains)) for each in found.assessments] == [
        ("As flown", better),
        ("As flown", DEFAULT),
    ]
    errors = [each.flown_error_m for each in found.assessments]
    assert None not in errors
    assert found.best.error == errors[0]


def test_a_takeoff_that_is_too_short_is_refused_with_its_length() -> None:
    with pytest.raises(TrajectoryError) as refused:
        analyze_takeoffs([flown(DEFAULT, fly_s=6.0)])
    assert reason_of(refused) == "has only takeoffs of 6.0 s with kp 283, ki 13, kd 82; at least 10 s are needed"


def test_a_takeoff_that_the_gains_in_the_log_cannot_fly_is_refused() -> None:
    honest = flown(DEFAULT)
    with pytest.raises(TrajectoryError) as refused:
        analyze_takeoffs(
            [LoggedTakeoff(number=1, gains={"kp": 1624, "ki": 900, "kd": 195}, trajectory=honest.trajectory)]
        )
    assert "flew with gains other than the log says" in reason_of(refused)


def test_a_takeoff_to_another_height_is_refused() -> None:
    record = flown(DEFAULT).trajectory
    low = replace(record, channels={"altitude_m": 0.4 * record["altitude_m"]})
    with pytest.raises(TrajectoryError) as refused:
        analyze_takeoffs([LoggedTakeoff(number=1, gains=DEFAULT, trajectory=low)])
    assert "climbed to a height other than 3 m" in reason_of(refused)


def test_gains_that_the_autopilot_cannot_hold_are_refused() -> None:
    with pytest.raises(TrajectoryError) as refused:
        analyze_takeoffs(
            [LoggedTakeoff(number=1, gains={"kp": 283.5, "ki": 13, "kd": 82}, trajectory=flown(DEFAULT).trajectory)]
        )
    assert "takeoff with kp that" in reason_of(refused)


@pytest.mark.complete
def test_the_same_log_gives_the_same_answer() -> None:
    one, other = (analyze_takeoffs([from_log("paparazzi_283_13_82.tlog")]) for _ in range(2))
    assert one.proposed == other.proposed
    assert np.array_equal(one.predicted["altitude_m"], other.predicted["altitude_m"])


def test_takeoffs_of_two_logs_are_compared_over_ten_seconds() -> None:
    """Which all of them last."""
    slow, fast = (from_log(f"paparazzi_{gains}.tlog") for gains in ("283_13_82", "1624_1356_195"))
    (found,) = score_takeoffs([slow])
    assert found.gains == slow.gains
    assert found.error_m == Takeoff(window_s=10.0).error(slow.trajectory)
    assert compare_takeoffs([found], score_takeoffs([fast])).verdict == "better"
