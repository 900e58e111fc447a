"""Flights of altitude steps under ArduCopter and PX4 until a method finds good gains: Gainline compared with black-box
searches, and with the sets that people fly without any.

    ./dev exec python -m bench.steps_to_target                      a few vehicles, against limits
    ./dev exec uv pip install --require-hashes -r requirements/bench.txt
    ./dev exec python -m bench.steps_to_target --vehicles 200 --methods all --results FILE --out docs

Prints tables; with `--out` writes them as the last section of flights-to-target.md there. `--results FILE` saves every
result at once; the same command continues where it was stopped, and computes nothing if FILE is complete. Exits with 1
beyond the limits, which are loose because the vehicles are few.
"""

import argparse
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from bench.copters.campaign_flights import RIGS
from bench.copters.steps_pages import Outcome, outcomes, section, tables
from bench.copters.steps_tuning import StepsTuning, best, calibrated, rules, search
from bench.flights_to_target import INSTALL
from bench.targets.methods import DISTRIBUTIONS, METHODS, SEARCHES
from bench.targets.pages import with_steps
from bench.targets.results import Record, Results, Task, work

SEED: Final = 20261128
QUICK_VEHICLES: Final = 3
LIMITS: Final[Mapping[str, float]] = {"near": 0.5, "ringing": 0.0}
_BEST, _RULES = "best", "rules"
_GAINLINE: Final = "calibrated"
_RUNS: Final = {_BEST: best, _RULES: rules, _GAINLINE: calibrated, **{name: search(name) for name in SEARCHES}}


def carry_out(task: Task, autopilot: str) -> Record:
    """Run one task."""
    return _RUNS[task.what](StepsTuning(autopilot, task.number, task.seed))


def chosen_methods(wanted: str) -> tuple[str, ...]:
    """Return the chosen methods. Exits if one is unknown or its libraries are missing."""
    known = (_GAINLINE, *SEARCHES)
    names = known if wanted == "all" else tuple(wanted.split(",")) if wanted else (_GAINLINE,)
    if unknown := [name for name in names if name not in known]:
        sys.exit(f"There is no method {', '.join(unknown)}; there are {', '.join(known)}.")
    if missing := sorted({DISTRIBUTIONS[each] for name in names for each in METHODS[name].missing}):
        sys.exit(f"These methods need {', '.join(missing)}. Install them with\n    {INSTALL}")
    return names


def tasks(methods: tuple[str, ...], vehicles: int, seed: int) -> list[tuple[Task, str]]:
    """Return the tasks, vehicle by vehicle."""
    return [
        (Task(population=autopilot, number=number, seed=seed, what=what), autopilot)
        for number in range(vehicles)
        for autopilot in RIGS
        for what in (_BEST, _RULES, *methods)
        if what not in METHODS or number < (METHODS[what].most_vehicles or vehicles)
    ]


def is_within_limits(found: Mapping[str, Mapping[str, Outcome]]) -> bool:
    """Print the figures with limits and return whether all are within these."""
    passed = True
    for autopilot, methods in found.items():
        if _GAINLINE not in methods:
            continue
        near, ringing = methods[_GAINLINE].near(2), methods[_GAINLINE].ringing
        print(f"{autopilot}: within 10 % by flight 2 {near} (limit {LIMITS['near']:.0%}); ringing flights {ringing}")
        passed &= near.value >= LIMITS["near"] and ringing.value <= LIMITS["ringing"]
    return passed


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.steps_to_target")
    parser.add_argument("--vehicles", type=int, default=QUICK_VEHICLES)
    parser.add_argument("--methods", default="", help=f"all, or a list of {_GAINLINE},{','.join(SEARCHES)}")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--results", type=Path, help="file of results, also to continue from")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, help="folder with flights-to-target.md")
    options = parser.parse_args()
    wanted = tasks(chosen_methods(options.methods), options.vehicles, options.seed)
    with tempfile.TemporaryDirectory() as folder:
        results = Results(options.results or Path(folder) / "results.jsonl")
        for _ in work(wanted, results, processes=options.processes, carry_out=carry_out):
            pass
    found = outcomes(results, [task for task, _ in wanted])
    for autopilot, each in found.items():
        print("", autopilot, *tables(each), sep="\n")
    if options.out:
        page = options.out / "flights-to-target.md"
        text = section(found, options.seed)
        page.write_text(with_steps(page.read_text(encoding="utf-8"), text), encoding="utf-8")
    return 0 if is_within_limits(found) else 1


if __name__ == "__main__":
    sys.exit(main())
