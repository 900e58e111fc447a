"""Number of flights that a method needs to find good gains: Gainline compared with alternatives.

    ./dev exec python -m bench.flights_to_target                     a few vehicles, Gainline alone, against its limits
    ./dev exec uv pip install --require-hashes -r requirements/bench.txt
    ./dev exec python -m bench.flights_to_target --vehicles 200 --twins 400 --methods all --out docs

Prints tables; with `--out` writes them and the figure there, and keeps the section of bench.steps_to_target. `--results
FILE` saves every result at once, and the same command continues where it was stopped. Exits with 1 if Gainline exceeds
the limits, which are loose because the vehicles are few.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Final

from bench.targets.methods import DISTRIBUTIONS, METHODS
from bench.targets.pages import TITLES, draw, page, safety, steps_of, summary, with_steps
from bench.targets.report import Outcome, outcomes
from bench.targets.results import OPTIMUM, Results, Task, carry_out, work
from bench.targets.vehicles import SampledVehicle, population

SEED: Final = 20261121
QUICK_VEHICLES: Final = 12
QUICK_FLIGHTS: Final = 3
LIMITS: Final[Mapping[str, float]] = {"four-parameter": 0.75, "further-physics": 0.75, "twin": 0.75}
"""Share of vehicles that Gainline must bring within 5 % by the third flight, loose because vehicles are few."""
MAX_UNSAFE: Final = 0.05
INSTALL: Final = "./dev exec uv pip install --require-hashes -r requirements/bench.txt"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bench.flights_to_target")
    parser.add_argument("--vehicles", type=int, default=QUICK_VEHICLES, help="vehicles of each random population")
    parser.add_argument("--twins", type=int, default=0, help="seeds on the twin of the paper's drone")
    parser.add_argument("--methods", default="", help=f"all, or a list of {','.join(METHODS)}")
    parser.add_argument("--flights", type=int, help="largest number of flights for each method")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--results", type=Path, help="file of results, also to continue from")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, help="folder for flights-to-target.md and images/flights-to-target.svg")
    return parser.parse_args()


def chosen_methods(wanted: str) -> tuple[str, ...]:
    """Return the chosen methods. Exits if one is unknown or its libraries are missing."""
    names = tuple(METHODS) if wanted == "all" else tuple(wanted.split(",")) if wanted else ("calibrated",)
    if unknown := [name for name in names if name not in METHODS]:
        sys.exit(f"There is no method {', '.join(unknown)}; there are {', '.join(METHODS)}.")
    if missing := sorted({DISTRIBUTIONS[each] for name in names for each in METHODS[name].missing}):
        sys.exit(f"These methods need {', '.join(missing)}. Install them with\n    {INSTALL}")
    return names


def tasks(methods: tuple[str, ...], vehicles: int, twins: int, seed: int) -> list[tuple[Task, SampledVehicle]]:
    """Return the tasks, vehicle by vehicle in all populations, beginning with the vehicle's own optimum."""
    optima: list[tuple[Task, SampledVehicle]] = []
    tunings: list[tuple[Task, SampledVehicle]] = []
    for name, count in (("four-parameter", vehicles), ("further-physics", vehicles), ("twin", twins)):
        for vehicle in population(name, count, seed):
            if name != "twin" or vehicle.number == 1:
                optima.append((Task(population=name, number=vehicle.number, seed=seed, what=OPTIMUM), vehicle))
            for method in methods:
                compared = METHODS[method]
                most = compared.most_twins if name == "twin" else compared.most_vehicles
                if most is not None and vehicle.number > most:
                    continue
                tunings.append((Task(population=name, number=vehicle.number, seed=seed, what=method), vehicle))
    return sorted(optima + tunings, key=lambda each: each[0].number)


def run(options: argparse.Namespace, results: Results) -> dict[str, dict[str, Outcome]]:
    """Run the tasks that are not in the results yet, and return the outcomes of every population."""
    methods = chosen_methods(options.methods)
    quick = QUICK_FLIGHTS if not options.methods and options.vehicles == QUICK_VEHICLES else None
    wanted = tasks(methods, options.vehicles, options.twins, options.seed)
    started = time.monotonic()
    fly = partial(carry_out, budget=options.flights or quick)
    carried_out = work(wanted, results, processes=options.processes, carry_out=fly)
    for done, task in enumerate(carried_out, 1):
        if done % 50 == 0:
            print(f"{done} done after {time.monotonic() - started:.0f} s; {task}", file=sys.stderr, flush=True)
    found = {name: outcomes(results, name, options.seed) for name in TITLES}
    return {name: each for name, each in found.items() if each}


def is_within_limits(found: Mapping[str, Mapping[str, Outcome]]) -> bool:
    """Print the figures that exceed their limits and return whether there are none."""
    passed = True
    for name, limit in LIMITS.items():
        outcome = found.get(name, {}).get("calibrated")
        if outcome is None:
            continue
        reached, unsafe = outcome.reached(0.05, 3), outcome.unsafe_flights
        print(f"{name}: within 5 % by flight 3 {reached} (limit {limit:.0%}); unsafe {unsafe} (limit {MAX_UNSAFE:.0%})")
        passed &= reached.value >= limit and not unsafe.value > MAX_UNSAFE
    return passed


def main() -> int:
    options = arguments()
    with tempfile.TemporaryDirectory() as folder:
        found = run(options, results := Results(options.results or Path(folder) / "results.jsonl"))
    for name, each in found.items():
        print("", f"{TITLES[name]}, within 5 %:", *summary(each, 0.05), *safety(each), sep="\n")
    if options.out:
        figure = Path("images") / "flights-to-target.svg"
        draw(found, options.out / figure)
        text = page(found, results, options.seed, figure.as_posix())
        document = options.out / "flights-to-target.md"
        steps = steps_of(document.read_text(encoding="utf-8")) if document.is_file() else ""
        document.write_text(with_steps(text, steps), encoding="utf-8")
    return 0 if is_within_limits(found) else 1


if __name__ == "__main__":
    sys.exit(main())
