"""Intervals, bands, and the record of how predictions held."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from app.core.definition import Definition, Flight, Interval, Prediction
from app.core.statistics.comparisons import groups_of
from app.core.tuning.corrected_model import correct_by_bias, uncorrected_model
from app.core.tuning.predictions import interval_scale, repeat_proposal, track_record, with_interval
from app.core.tuning.strategy import Explanation, Proposal, proposal_of
from bench.predictions import prediction_of
from tests.core.tuning.bowl import OFFSET, QuadraticExperiment, fly
from tests.core.tuning.defined import evidence

T = float(stats.t.ppf(0.95, 4))
WHY = Explanation(summary="Because.")

CHANGED = "with new gains changed the error in the predicted direction (repeats are not counted)"


def told(flight: Flight, error: float, half: float | None = None) -> Flight:
    interval = None if half is None else Interval(lower=error - half, upper=error + half)
    return replace(flight, predicted=Prediction(error=error, interval=interval))


def proposal(a: float, b: float, base: Flight | None = None) -> Proposal:
    model = uncorrected_model(QuadraticExperiment()) if base is None else correct_by_bias(QuadraticExperiment(), base)
    gains = {"a": a, "b": b}
    return proposal_of("step", gains, model.predict(QuadraticExperiment.space.vector(gains)), WHY)


def test_a_model_whose_bias_takes_everything_away_leaves_the_scatter_of_two_flights() -> None:
    """The bowl's only parameter is an offset, which the bias of the base flight holds whatever it is."""
    base = fly(1, 50, 50)
    found = with_interval(evidence(Definition(), QuadraticExperiment(), [base]), proposal(30, 40, base), base=base)
    assert found.interval is not None
    assert found.predicted is not None
    half = T * 0.01 * np.sqrt(2.0)
    assert found.interval.upper - found.interval.lower == pytest.approx(2.0 * half, rel=1e-6)
    assert found.interval.confidence == 0.9
    upper, middle = found.predicted["depth_upper"], found.predicted["depth"]
    assert upper - middle == pytest.approx(np.full_like(middle, half), rel=1e-6)
    assert middle - found.predicted["depth_lower"] == pytest.approx(upper - middle)


def test_repeats_of_the_base_narrow_the_interval() -> None:
    flights = [fly(1, 50, 50), fly(2, 50, 50), fly(3, 50, 50)]
    known = evidence(Definition(), QuadraticExperiment(), flights)
    found = with_interval(known, proposal(30, 40, flights[0]), base=flights[0])
    assert found.interval is not None
    repeats = stats.t.ppf(0.95, 6) * 0.01 * np.sqrt(4.0 / 6.0)  # two identical repeats beside the prior's four
    assert found.interval.upper - found.interval.lower == pytest.approx(2.0 * repeats * np.sqrt(4.0 / 3.0), rel=1e-6)


def test_before_the_first_flight_the_interval_is_what_a_fit_would_take_for_likely() -> None:
    """The offset has a standard deviation of 0.1; it is the error's own."""
    found = with_interval(evidence(Definition(), QuadraticExperiment(), []), proposal(60, 60), base=None)
    assert found.interval is not None
    half = (found.interval.upper - found.interval.lower) / 2
    assert half == pytest.approx(T * 0.1, rel=0.25)


def test_an_interval_is_where_the_likely_models_are_and_holds_the_prediction() -> None:
    """The data sheet says offset 0, experience 0.8."""
    bowl = QuadraticExperiment()
    bowl.model_parameters = (replace(OFFSET, expected=0.8, prior_sd=0.05),)
    found = with_interval(evidence(Definition(), bowl, []), proposal(30, 40), base=None)
    assert found.interval is not None
    assert found.predicted is not None
    assert found.predicted_error == pytest.approx(1.0)
    assert found.interval.lower == pytest.approx(1.0)
    assert found.interval.upper == pytest.approx(1.8 + T * 0.05, abs=0.03)
    assert (found.predicted["depth_lower"] <= found.predicted["depth"]).all()


def test_what_has_an_interval_or_predicts_nothing_stays_as_it_is() -> None:
    base = fly(1, 50, 50)
    mute = replace(proposal(30, 40), predicted=None, predicted_error=None)
    assert with_interval(evidence(Definition(), QuadraticExperiment(), [base]), mute, base=base) is mute
    assert prediction_of(mute) is None
    done = with_interval(evidence(Definition(), QuadraticExperiment(), [base]), proposal(30, 40, base), base=base)
    assert with_interval(evidence(Definition(), QuadraticExperiment(), [base]), done, base=base) is done


def test_a_flight_carries_its_prediction() -> None:
    bare = proposal(30, 40)
    assert prediction_of(bare) == Prediction(error=1.0)
    done = with_interval(evidence(Definition(), QuadraticExperiment(), []), bare, base=None)
    assert done.interval is not None
    assert prediction_of(done) == Prediction(error=1.0, interval=done.interval)


def test_another_flight_of_a_policy_is_expected_at_the_mean_of_its_flights() -> None:
    flights = [fly(1, 50, 50, 0.2), fly(2, 30, 40), fly(3, 50, 50, 0.3)]
    group = groups_of(flights)[0]
    again = repeat_proposal(evidence(Definition(), QuadraticExperiment(), flights), group, "repeat", WHY)
    assert again.predicted is not None
    assert again.interval is not None
    assert (again.kind, again.gains) == ("repeat", {"a": 50, "b": 50})
    assert again.predicted_error == pytest.approx(group.mean)
    assert again.predicted["depth"] == pytest.approx(np.full(11, 6.25), abs=1e-6)
    scatter = np.sqrt((4.0 * 0.01**2 + 2.0 * 0.05**2) / 5.0)  # the prior's, with the two flights' 0.05 from their mean
    assert again.interval.upper - group.mean == pytest.approx(stats.t.ppf(0.95, 5) * scatter * np.sqrt(1.5), rel=1e-4)


def test_gains_whose_repeats_gave_the_same_error_are_predicted_without_scatter() -> None:
    """As in a simulation without noise: an interval would be the prior's, which the flights contradict."""
    flights = [fly(1, 50, 50), fly(2, 30, 40), fly(3, 30, 40)]
    groups = groups_of(flights)
    again = repeat_proposal(evidence(Definition(), QuadraticExperiment(), flights), groups[0], "repeat", WHY)
    assert again.predicted_error == groups[0].mean
    assert again.interval is None
    assert again.predicted is not None
    assert set(again.predicted.channels) == {"depth"}


def test_misses_widen_the_next_interval_and_hits_narrow_it() -> None:
    """f² = (4 + Σz²)/(4 + k), z in standard deviations of the interval."""
    z = float(stats.norm.ppf(0.95))
    exact = replace(fly(1, 50, 50), error=1.0)
    assert interval_scale([exact]) == 1.0
    assert interval_scale([told(exact, 1.0, 0.1)]) == pytest.approx(np.sqrt(4 / 5))
    assert interval_scale([told(exact, 1.2, 0.1)]) == pytest.approx(np.sqrt((4 + (2 * z) ** 2) / 5))
    assert interval_scale([told(exact, 1.2)]) == 1.0


def flights_of(*errors: float, predicted: float) -> list[Flight]:
    """The first without a prediction, each other predicted to reach `predicted`."""
    flown = [replace(fly(number, number, 40), error=error) for number, error in enumerate(errors, start=1)]
    return [flown[0], *(told(flight, predicted, 0.05) for flight in flown[1:])]


def test_the_record_counts_flights_inside_their_interval_and_predicted_directions() -> None:
    record = track_record(flights_of(0.5, 0.32, 0.4, predicted=0.3))
    assert (record.inside, record.of, record.share) == (1, 2, 0.5)
    assert (record.agreeing, record.disagreeing, record.trustworthy) == (1, 1, True)
    assert record.sentence == (f"1 of 2 flights ended inside their predicted interval; 1 of 2 flights {CHANGED}.")


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (
            0.32,
            f"The only predicted flight ended inside its interval; 1 of 1 flight {CHANGED}.",
        ),
        (
            0.6,
            f"The only predicted flight ended outside its interval; 0 of 1 flight {CHANGED}.",
        ),
    ],
)
def test_the_record_of_one_predicted_flight_is_told_in_the_singular(error: float, sentence: str) -> None:
    assert track_record(flights_of(0.5, error, predicted=0.3)).sentence == sentence


def test_the_gradient_is_not_trustworthy_once_three_flights_went_the_other_way_and_fewer_its_own() -> None:
    assert track_record(flights_of(0.5, 0.6, 0.6, predicted=0.3)).trustworthy
    record = track_record(flights_of(0.5, 0.6, 0.6, 0.6, predicted=0.3))
    assert (record.disagreeing, record.trustworthy) == (3, False)
    assert "the gradient is not trustworthy" in record.sentence
    assert track_record(flights_of(0.5, 0.45, 0.42, 0.40, 0.6, 0.6, 0.6, predicted=0.3)).trustworthy


def test_flights_flown_again_and_flights_that_do_not_count_predict_no_direction() -> None:
    first = replace(fly(1, 50, 50), error=0.5)
    again = told(replace(fly(2, 50, 50), error=0.6), 0.5, 0.05)
    aborted = replace(told(fly(3, 30, 40), 0.3, 0.1), error=None, outcome="aborted")
    record = track_record([first, again, aborted])
    assert (record.of, record.inside, record.agreeing + record.disagreeing) == (1, 0, 0)
    empty = track_record([first])
    assert (empty.share, empty.sentence) == (None, "No prediction has been tested by a flight yet.")
