"""The arithmetic of the comparison by altitude steps; what it compares is measured by the bench itself."""

from pathlib import Path

import pytest

from bench.copters.campaign_flights import RIGS
from bench.copters.steps_pages import outcomes, section, tables
from bench.copters.steps_tuning import StepsTuning, rules, search
from bench.steps_to_target import chosen_methods, tasks
from bench.targets.pages import steps_of, with_steps
from bench.targets.results import Results, Task
from tests.core.tuning.flying import compiled_only


def task(what: str) -> Task:
    return Task(population="PX4", number=0, seed=1, what=what)


def judged(expected: float, *, rings: bool = False) -> dict[str, object]:
    return {"expected": expected, "rings": rings, "lacks_margin": rings}


@pytest.fixture
def results(tmp_path: Path) -> Results:
    found = Results(tmp_path / "results.jsonl")
    found.add(task("best"), {"expected": 0.1})
    found.add(task("rules"), {"rules": {"PX4's default gains": judged(0.2), "1.5, 15, 3, 0": judged(0.15, rings=True)}})
    flights = [(0.2, 0.2, False), (0.5, 0.2, True), (0.11, 0.109, False)]
    found.add(
        task("nelder-mead"),
        {
            "ended": "budget",
            "flights": [
                {"error": error, "rings": rings, "compute_s": 0.0, "recommended": judged(recommended)}
                for error, recommended, rings in flights
            ],
        },
    )
    return found


def test_a_method_counts_by_what_it_recommends_after_each_flight(results: Results) -> None:
    found = outcomes(results, [task(what) for what in ("best", "rules", "nelder-mead", "calibrated")])["PX4"]
    assert list(found) == ["nelder-mead", "PX4's default gains", "1.5, 15, 3, 0"]
    method = found["nelder-mead"]
    assert [method.near(number).count for number in (1, 2, 3, 40)] == [0, 0, 1, 1]
    assert method.errors_m(40).tolist() == [0.109]
    assert (method.ringing.count, method.ringing.of, method.ends_ringing) == (1, 2, 0)
    assert (found["1.5, 15, 3, 0"].flights, found["1.5, 15, 3, 0"].ends_without_margin) == (0, 1)
    written = tables(found)
    assert written[2].startswith("| Nelder–Mead on the vehicle | 1 | 3 | 200.0 mm | 109.0 mm | 109.0 mm |")
    assert written[3].startswith("| PX4's default gains | 1 | none | 200.0 mm |")
    assert written[-1] == "Best of the grid: median 100.0 mm, of 1 vehicles."


def test_the_section_is_replaced_and_kept_by_the_rest_of_the_page(results: Results) -> None:
    text = section(outcomes(results, [task("best"), task("rules")]), 1)
    page = with_steps("# Flights to the target\n\nText.\n", text)
    assert steps_of(page) == text
    assert with_steps(page, text) == page
    assert with_steps(page, "") == "# Flights to the target\n\nText.\n"
    assert steps_of("# Flights to the target\n") == ""


def test_slow_methods_tune_the_first_vehicles() -> None:
    wanted = [each for each, _ in tasks(chosen_methods("nelder-mead"), 2, 1)]
    assert [(each.population, each.what) for each in wanted[:3]] == [
        ("ArduCopter", "best"),
        ("ArduCopter", "rules"),
        ("ArduCopter", "nelder-mead"),
    ]
    assert len(wanted) == 2 * len(RIGS) * 3
    with pytest.raises(SystemExit, match="There is no method luck"):
        chosen_methods("luck")


@pytest.mark.complete
@compiled_only
def test_a_search_flies_its_budget_and_is_judged_in_other_weather() -> None:
    tuning = StepsTuning("PX4", 0, 1, budget=3)
    found = search("nelder-mead")(tuning)
    assert (found["ended"], len(tuning.flights)) == ("budget", 3)
    defaults = tuning.judged(tuning.first)
    assert tuning.flights[0]["recommended"] == defaults
    given = rules(StepsTuning("PX4", 0, 1))["rules"]
    assert isinstance(given, dict)
    assert given["PX4's default gains"] == defaults
