"""The arithmetic of the comparison; what it compares is measured by the bench itself."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bench.flights_to_target import chosen_methods, is_within_limits, tasks
from bench.targets.flying import DEFAULT, SPACE, BudgetSpentError, Tuning, tune
from bench.targets.methods import METHODS
from bench.targets.pages import page, summary
from bench.targets.report import Course, Outcome, Share, course_of, outcomes
from bench.targets.results import OPTIMUM, Results, Task, carry_out, work
from bench.targets.vehicles import noise_free_error, population

TASK = Task(population="four-parameter", number=1, seed=9, what="nelder-mead")


def course(*excess: float, budget: int = 60, ended: str = "budget", unsafe: tuple[int, ...] = ()) -> Course:
    """A course whose flights numbered in `unsafe` are."""
    count = len(excess)
    return Course(
        excess=excess,
        unsafe=tuple(number in unsafe for number in range(1, count + 1)),
        counts=(False, *[True] * (count - 1)),
        compute_s=tuple(float(number) for number in range(count)),
        inside=(True, False),
        ended=ended,
        budget=budget,
    )


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_intervals_are_the_published_ones(count: int, of: int, low: float, high: float) -> None:
    """R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3, to its four decimals."""
    assert Share(count, of).interval == pytest.approx((low, high), abs=5e-5)


def test_shares_are_written_with_their_intervals() -> None:
    assert str(Share(81, 263)) == "31 % (26–37 %)"
    assert Share(1, 29).rounded(1) == "3.4 % (0.6–17.2 %)"
    assert str(Share(0, 0)) == "–"


def test_a_target_is_reached_at_the_first_flight_whose_recommendation_is_within_it() -> None:
    flown = course(2.0, 0.06, 0.04, 0.10, 0.01)
    assert (flown.reached(0.05), flown.reached(0.02), flown.reached(0.001)) == (3, 5, None)


def test_reaching_is_kept_and_standing_is_not() -> None:
    flown = Outcome((course(2.0, 0.04, 0.10), course(2.0, 0.5, 0.04)))
    assert [flown.reached(0.05, number).count for number in (1, 2, 3, 40)] == [0, 1, 2, 2]
    assert [flown.standing(0.05, number).count for number in (1, 2, 3, 40)] == [0, 1, 1, 1]
    settled = replace(course(2.0, 0.04, 0.10), settled=0.04)
    assert [settled.is_standing(0.05, number) for number in (2, 3, 4)] == [True, False, True]


def test_the_median_of_vehicles_that_mostly_never_arrive_is_beyond_the_budget() -> None:
    assert Outcome((course(0.04), course(2.0, 0.04), course(2.0, 2.0, 0.04))).median_flights(0.05) == "2"
    assert Outcome((course(0.04), course(2.0), course(2.0))).median_flights(0.05) == "> 60"


def test_unsafe_flights_are_counted_on_the_way_without_first_and_default_ones() -> None:
    flown = course(2.0, 1.0, 0.04, 0.04, 0.04, unsafe=(1, 2, 4))
    assert flown.unsafe_on_the_way(0.05) == 1
    assert flown.unsafe_on_the_way(0.01) == 2
    assert (Outcome((flown,)).unsafe_flights.count, Outcome((flown,)).unsafe_flights.of) == (2, 4)
    assert Outcome((flown, course(0.01))).unsafe_starts == Share(1, 2)


def test_default_gains_flown_again_count_as_no_flight_on_the_way() -> None:
    def flight(gains: list[float], interval: list[float] | None) -> dict[str, object]:
        return {
            "gains": gains,
            "error": 0.2,
            "is_unsafe": True,
            "chosen": gains,
            "chosen_error": 0.11,
            "compute_s": 0.5,
            "interval": interval,
        }

    default = list(DEFAULT.values())
    flights = [
        flight(default, [0.0, 1.0]),
        flight([1, 2, 3], [0.1, 0.15]),
        flight(default, [0.1, 0.2]),
        flight([4, 5, 6], None),
    ]
    read = course_of(flights, best=0.1, ended="budget", budget=4)
    assert read.counts == (False, True, False, True)
    assert read.inside == (False, True)
    assert read.excess == pytest.approx([0.1] * 4)


def test_a_black_box_method_stands_by_its_best_observed_and_flights_are_counted() -> None:
    vehicle = population("twin", 1, 1)[0]
    tuning = Tuning(vehicle=vehicle, seed=3, budget=3)
    tried = [SPACE.default, np.array([1600.0, 1000.0, 130.0]), np.array([300.0, 20.0, 82.0])]
    errors = [tuning.error(gains) for gains in tried]
    assert errors[1] < errors[2] < errors[0]
    assert [flight.chosen for flight in tuning.flights] == [(283, 13, 82), (1600, 1000, 130), (1600, 1000, 130)]
    expected = noise_free_error(vehicle, {"kp": 1600, "ki": 1000, "kd": 130})
    assert tuning.flights[2].chosen_error == expected
    with pytest.raises(BudgetSpentError):
        tuning.error(SPACE.default)


def test_every_method_meets_the_same_scatter_on_the_same_vehicle() -> None:
    vehicle = population("four-parameter", 2, 1)[1]
    one, other = (Tuning(vehicle=vehicle, seed=3, budget=2) for _ in range(2))
    assert one.error(SPACE.default) == other.error(SPACE.default)
    assert one.error(SPACE.default) != one.flights[0].error


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.complete) if name.endswith("-gate") else name
        for name, method in METHODS.items()
        if not method.missing
    ],
)
def test_every_method_flies_its_start_and_keeps_to_its_budget(name: str) -> None:
    """The start is the default gains, or the optimum that Nelder–Mead finds on the nominal model."""
    tuning = Tuning(vehicle=population("four-parameter", 1, 1)[0], seed=3, budget=4)
    record = tune(METHODS[name].run, tuning)
    assert tuning.flights[0].gains == ((1742, 881, 119) if "simplex" in name else tuple(DEFAULT.values()))
    assert len(tuning.flights) == 4 or record["ended"] != "budget"
    for flight in tuning.flights:
        SPACE.check(dict(zip(SPACE.names, flight.gains, strict=True)))


@pytest.mark.complete
def test_the_papers_method_as_published_flies_what_the_gate_refuses() -> None:
    """On this vehicle, which overshoots in the first flight, the gate refuses every step of the first line."""
    vehicle = population("further-physics", 1, 20261121)[0]
    published, gated = (Tuning(vehicle=vehicle, seed=20261121, budget=2) for _ in range(2))
    ended = [
        tune(METHODS[name].run, tuning)["ended"]
        for name, tuning in (("gradient-raw", published), ("gradient-raw-gate", gated))
    ]
    assert published.flights[0].error == gated.flights[0].error
    assert (len(published.flights), len(gated.flights)) == (2, 1)
    assert ended == ["budget", "nothing better"]


def test_results_are_read_again_and_a_line_cut_off_is_dropped(tmp_path: Path) -> None:
    file = tmp_path / "results.jsonl"
    vehicle = population(TASK.population, 1, TASK.seed)[0]
    first = Results(file)
    first.add(TASK, carry_out(TASK, vehicle, budget=2))
    file.write_text(file.read_text() + '{"task":{"population":"twin","num')
    again = Results(file)
    assert list(again) == [TASK]
    assert again[TASK]["flights"] == json.loads(json.dumps(first[TASK]["flights"]))
    assert list(work([(TASK, vehicle)], again, processes=1, carry_out=carry_out)) == []
    assert file.read_text().count("\n") == 1


@pytest.mark.complete
def test_what_is_missing_is_made_in_processes_and_reported(tmp_path: Path) -> None:
    results = Results(tmp_path / "results.jsonl")
    vehicle = population(TASK.population, 1, TASK.seed)[0]
    optimum = Task(population=TASK.population, number=1, seed=TASK.seed, what=OPTIMUM)
    assert set(
        work([(optimum, vehicle), (TASK, vehicle)], results, processes=1, carry_out=partial(carry_out, budget=3))
    ) == {optimum, TASK}
    found = {"four-parameter": outcomes(results, "four-parameter", TASK.seed)}
    assert found["four-parameter"]["nelder-mead"].budget == 3
    assert len(summary(found["four-parameter"], 0.05)) == 3
    text = page(found, results, TASK.seed, "images/figure.svg")
    assert "flight (kp 1742, ki 881, kd 119, the same for all vehicles)" in text
    assert "| Nelder–Mead on the vehicle | 1 | 3 | 0 % (0–79 %)" in text
    assert f"Seed {TASK.seed}; flown on 20" in text


def test_slow_methods_tune_the_first_vehicles_only_and_black_box_methods_no_twins() -> None:
    planned = [task for task, _ in tasks(("calibrated", "gradient-raw", "gp"), vehicles=60, twins=60, seed=1)]
    assert sum(task.what == "gp" for task in planned) == 2 * 25
    twins = [task.what for task in planned if task.population == "twin"]
    assert (twins.count("calibrated"), twins.count("gradient-raw"), twins.count("gp")) == (60, 50, 0)
    assert sum(task.what == OPTIMUM for task in planned) == 2 * 60 + 1


def test_figures_beyond_the_limits_are_told() -> None:
    good = Outcome(tuple(course(2.0, 0.01) for _ in range(12)))
    bad = Outcome(tuple(course(2.0, 0.5, unsafe=(2,)) for _ in range(12)))
    assert is_within_limits({"four-parameter": {"calibrated": good, "tpe": bad}})
    assert not is_within_limits({"four-parameter": {"calibrated": bad}})


def test_an_unknown_method_or_a_missing_library_is_reported_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit, match="There is no method annealing"):
        chosen_methods("annealing")
    monkeypatch.setattr("bench.flights_to_target.METHODS", {"tpe": SimpleNamespace(missing=("optuna",))})
    with pytest.raises(SystemExit, match=r"requirements/bench\.txt"):
        chosen_methods("tpe")
