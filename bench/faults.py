"""Whole trials in lockstep, each with something wrong with the vehicle, the link or the wire, and an abort in between.

    ./dev exec python -m bench.faults                                 a sample, as .ci/run has it
    ./dev exec python -m bench.faults --runs 500 --seed 20261121 --results FILE --out docs
    ./dev exec python -m bench.faults --only 20261130                 one run again, with all that is known of it

A run is drawn from its seed; the seeds count up from `--seed`, and so go through every mishap in every state of a
trial. The vehicle is a simulated drone in lockstep with the program; a tap at its antenna reads every packet that the
program sends. What the program did is judged from the wire and from what the drone truly holds, by what
docs/real-flight.md asks for (bench/hazards/expected.py). Prints what went wrong and a table; with `--out` writes
faults.md there. Exits 1 when a single run is not as asked.
"""

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Final

from bench.hazards.pages import page, summary
from bench.hazards.results import Line, fly, fly_all, stored

SEED: Final = 20261121
SAMPLE: Final = 20
STRIDE: Final = 12
"""Of the sample's seeds: each has another mishap than the one before, in another state."""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bench.faults")
    parser.add_argument("--runs", type=int, help=f"how many seeds in a row; without it, {SAMPLE} that lie apart")
    parser.add_argument("--seed", type=int, default=SEED, help="the first")
    parser.add_argument("--only", type=int, metavar="SEED", help="this run alone")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--results", type=Path, help="file for a line of JSON a run; those in it are not flown again")
    parser.add_argument("--out", type=Path, help="folder for faults.md")
    return parser.parse_args()


def seeds(options: argparse.Namespace) -> list[int]:
    if options.runs is None:
        return [options.seed + STRIDE * number for number in range(SAMPLE)]
    return list(range(options.seed, options.seed + options.runs))


def known(results: Path | None) -> list[Line]:
    if results is None or not results.exists():
        return []
    return [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]


def run(options: argparse.Namespace) -> list[Line]:
    """Fly what is not in the results yet; all of them, by seed."""
    wanted = seeds(options)
    lines = [line for line in known(options.results) if line["seed"] in wanted]
    missing = sorted(set(wanted) - {line["seed"] for line in lines})
    for line in fly_all(missing, processes=options.processes):
        lines.append(line)
        if line["wrong"]:
            print(f"{line['seed']} {line['autopilot']}: {line['wrong']}", flush=True)
        if options.results:
            with options.results.open("a", encoding="utf-8") as file:
                file.write(stored(line) + "\n")
    return sorted(lines, key=lambda line: int(str(line["seed"])))


def main() -> int:
    options = arguments()
    if options.only is not None:
        line = fly(options.only)
        print(json.dumps(line, indent=1))
        return 1 if line["wrong"] else 0
    lines = run(options)
    print(summary(lines))
    if options.out:
        (options.out / "faults.md").write_text(page(lines), encoding="utf-8")
    return 1 if any(line["wrong"] for line in lines) else 0


if __name__ == "__main__":
    sys.exit(main())
