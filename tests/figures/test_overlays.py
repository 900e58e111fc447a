"""Many flights in one drawing: the envelope, the curves of their own, and what a closer look adds."""

from dataclasses import replace

import numpy as np
import pytest

from app.figures.data import Curve, FlightData, Range, thinned
from app.figures.error_history import ErrorsFigure
from app.figures.gains import GainsFigure
from app.figures.overlays import MANY, MAX_INDIVIDUAL_FLIGHTS, envelope_of, select_individual_flights
from app.figures.takeoffs import TrajectoriesFigure
from tests.figures.builders import TIME_S, climb, flight, history, trace, traces

FLIGHTS = 200
RANDOM = np.random.default_rng(5)


def rugged(number: int, error: float) -> FlightData:
    """A flight with its own overshoot."""
    return replace(flight(number, error), curve=climb(float(RANDOM.uniform(0.0, 0.8))))


CROWD = tuple(rugged(number, 0.5 - 0.4 * ((number * 37) % FLIGHTS) / FLIGHTS) for number in range(1, FLIGHTS + 1))


def test_the_envelope_holds_eighty_percent_of_the_flights_at_every_instant() -> None:
    found = envelope_of(CROWD, float(TIME_S[-1]))
    assert found is not None
    assert found.flights == FLIGHTS
    lower, median, upper = found.curves
    for index in (0, 40, 60, 100, -1):
        at_s = float(median.time_s[index])
        heights = sorted(float(np.interp(at_s, one.curve.time_s, one.curve.values)) for one in CROWD)
        below = sum(height < lower.values[index] - 1e-9 for height in heights)
        above = sum(height > upper.values[index] + 1e-9 for height in heights)
        assert below <= FLIGHTS // 10
        assert above <= FLIGHTS // 10
        middle = (heights[FLIGHTS // 2 - 1] + heights[FLIGHTS // 2]) / 2
        assert median.values[index] == pytest.approx(middle, abs=1e-9)


def test_flights_that_do_not_count_are_not_in_the_envelope() -> None:
    wild = replace(flight(FLIGHTS + 1, None, outcome="invalid", overshoot_m=50.0))
    assert envelope_of([wild], 32.6) is None
    with_it, without = (envelope_of(flights, 32.6) for flights in ((*CROWD, wild), CROWD))
    assert with_it is not None
    assert without is not None
    np.testing.assert_array_equal(with_it.curves[-1].values, without.curves[-1].values)


def test_of_many_flights_the_first_the_best_the_latest_and_the_chosen_one_have_curves_of_their_own() -> None:
    past = history(*CROWD)
    best = min(CROWD, key=lambda one: (one.error, one.number))
    emphasised = select_individual_flights(past)
    assert {1, best.number, FLIGHTS} <= emphasised
    assert len(emphasised) <= 12
    chosen = next(one.number for one in CROWD if one.number not in emphasised)
    drawn = TrajectoriesFigure(replace(past, chosen=chosen)).compute()
    numbers = {one["meta"]["trial"] for one in traces(drawn) if one["meta"]["role"] == "flight"}
    assert numbers == emphasised | {chosen}
    assert trace(drawn, "flight", trial=chosen)["uid"] == f"flight-{chosen}"
    assert sum(len(one["x"]) for one in traces(drawn)) < 8_000


def test_a_few_flights_are_all_drawn_by_themselves() -> None:
    few = CROWD[:MAX_INDIVIDUAL_FLIGHTS]
    card = TrajectoriesFigure(history(*few)).compute()
    assert not [one for one in traces(card) if one["meta"]["role"] == "envelope"]
    assert len([one for one in traces(card) if one["meta"]["role"] == "flight"]) == MAX_INDIVIDUAL_FLIGHTS


def test_the_table_gives_the_envelope_in_numbers() -> None:
    card = TrajectoriesFigure(history(*CROWD)).compute()
    assert card.table is not None
    names = [column.name for column in card.table.columns]
    at_two_seconds = dict(zip(names, next(row for row in card.table.rows if row[0] == 2.0), strict=True))
    heights = [float(np.interp(2.0, one.curve.time_s, one.curve.values)) for one in CROWD if one.curve]
    for name, percent in (("envelope_lower", 10), ("envelope_middle", 50), ("envelope_upper", 90)):
        # Between two instants of the envelope the table reads a straight line.
        assert at_two_seconds[name] == pytest.approx(float(np.percentile(heights, percent)), abs=2e-3)


def test_a_closer_look_shows_more_of_the_record_there_and_no_less_elsewhere() -> None:
    time_s = np.linspace(0.0, 32.6, 16_700)
    record = Curve(time_s, 3.0 + 0.02 * np.random.default_rng(1).standard_normal(16_700))
    past = history(replace(flight(1, 0.3), curve=record))
    whole, close = (
        trace(TrajectoriesFigure(replace(past, window=looked)).compute(), "flight", trial=1)
        for looked in (Range(0.0, 32.6), Range(4.0, 5.0))
    )
    inside = [(at_s, value) for at_s, value in zip(close["x"], close["y"], strict=True) if 4.0 <= at_s <= 5.0]
    assert len(inside) > 10 * sum(4.0 <= at_s <= 5.0 for at_s in whole["x"])
    np.testing.assert_allclose(
        [value for _, value in inside], np.interp([at_s for at_s, _ in inside], time_s, record.values), atol=3e-3
    )
    recorded = record.values[(time_s >= 4.0) & (time_s <= 5.0)]
    assert max(value for _, value in inside) == pytest.approx(recorded.max(), abs=1e-4)
    assert min(value for _, value in inside) == pytest.approx(recorded.min(), abs=1e-4)
    outside = [at_s for at_s in whole["x"] if not 4.0 <= at_s <= 5.0]
    assert set(outside) <= set(close["x"])
    assert close["x"] == sorted(close["x"])


@pytest.mark.parametrize("window", [Range(-5.0, -1.0), Range(40.0, 50.0), Range(0.0, 99.0)])
def test_a_look_beside_the_record_loses_nothing_of_it(window: Range) -> None:
    x, y = thinned(climb(0.3), 100, window)
    assert (x[0], x[-1]) == (0.0, 32.6)
    assert len(x) == len(y) == len(set(x))


def test_the_marks_of_many_flights_are_bare_and_all_there() -> None:
    assert FLIGHTS > MANY
    errors = ErrorsFigure(history(*CROWD)).compute()
    measured = trace(errors, "measured")
    assert (len(measured["x"]), "error_y" in measured) == (FLIGHTS, False)
    gains = GainsFigure(history(*CROWD)).compute()
    assert trace(gains, "flown", gain="kp")["mode"] == "lines"
    best = min(CROWD, key=lambda one: (one.error, one.number))
    assert trace(gains, "best", gain="kp")["x"] == [best.number]
