"""Whole trials in lockstep, each with injected faults of the vehicle or the link, or acts of the operator.

    ./dev exec python -m bench.faults                                 a sample, as in .ci/run
    ./dev exec python -m bench.faults --runs 500 --seed 20261121 --results FILE --out docs
    ./dev exec python -m bench.faults --only 20261130                 one run again, with all details

The seed determines a run; consecutive seeds, starting from `--seed`, cover every fault in every state of a trial. The
vehicle is a simulated drone in lockstep with the program, and a tap at its antenna reads every packet that the program
sends. The program's behaviour is checked from these packets and the drone's true state against docs/real-flight.md
(bench/hazards/fault_checks.py). Prints the violations and a summary; with `--out` writes faults.md there. Exits with 1
if there is a violation.
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
"""Step between the seeds of the sample, so that each has another fault in another state than the one before."""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bench.faults")
    parser.add_argument("--runs", type=int, help=f"number of consecutive seeds; default: a sample of {SAMPLE}")
    parser.add_argument("--seed", type=int, default=SEED, help="first seed")
    parser.add_argument("--only", type=int, metavar="SEED", help="fly this run only")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--results", type=Path, help="file of results, a line of JSON for each run; runs in it are not repeated"
    )
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
    """Fly the runs that are not in the results yet, and return all results by seed."""
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
