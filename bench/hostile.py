"""Whole trials in lockstep over a hostile link, or with a fault of the vehicle, checked for unsafe behaviour.

    ./dev exec python -m bench.hostile                          a sample, as .ci/run has it
    ./dev exec python -m bench.hostile --all --out docs         every hazard in every state, three autopilots
    ./dev exec python -m bench.hostile --only 117               one run again

Prints the violations and a table; with `--out` writes hostile-links.md there. Exits with 1 if there is a violation.
"""

import argparse
import multiprocessing
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from bench.hazards.cases import Case
from bench.hazards.hostile_checks import LOST
from bench.hazards.hostile_table import HAZARDS
from bench.hazards.hostile_trial import HostileResult, cases, run_trial

STRIDE: Final = 47
"""Step between the cases of the sample, chosen so that it covers hazards, states and autopilots."""
VERDICTS: Final = ("completed", "aborted", "invalid", "refused", LOST)
VEHICLE_STATES: Final = ("safe", "quarantined", "unopened")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bench.hostile")
    parser.add_argument("--all", action="store_true", help="every case, not a sample")
    parser.add_argument("--only", type=int, metavar="SEED", help="this run alone")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="folder for hostile-links.md")
    return parser.parse_args()


def fly(case: Case) -> tuple[Case, HostileResult]:
    try:
        return case, run_trial(case)
    except Exception as error:  # noqa: BLE001 - a run that raises has failed
        why = f"the run raised {type(error).__name__}: {error}"
        return case, HostileResult("", "", "", str(case.faults[0]), (why,))


def fly_all(chosen: Sequence[Case], processes: int) -> Iterator[tuple[Case, HostileResult]]:
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        yield from pool.imap_unordered(fly, chosen)


def table(flown: Sequence[tuple[Case, HostileResult]]) -> Iterator[str]:
    yield f"| hazard | runs | {' | '.join((*VERDICTS, *VEHICLE_STATES))} | failures | wrong |"
    yield "| --- |" + " --- |" * (len(VERDICTS) + len(VEHICLE_STATES) + 3)
    for name in HAZARDS:
        ended = [each for case, each in flown if case.faults[0].kind == name]
        verdicts, left = Counter(each.outcome for each in ended), Counter(each.vehicle for each in ended)
        counts = [*(verdicts[each] for each in VERDICTS), *(left[each] for each in VEHICLE_STATES)]
        failures = ", ".join(sorted({each.failure for each in ended if each.failure}))
        wrong = sum(bool(each.wrong) for each in ended)
        cells = " | ".join(str(cell or "") for cell in (len(ended), *counts, failures, wrong))
        yield f"| {name} | {cells} |"


def page(flown: Sequence[tuple[Case, HostileResult]]) -> str:
    autopilots = Counter(case.autopilot for case, _ in flown)
    wrong = [f"\n- {case.seed}, {case.autopilot}: {'; '.join(each.wrong)}" for case, each in flown if each.wrong]
    return _PAGE.format(
        runs=len(flown),
        right=len(flown) - len(wrong),
        autopilots=", ".join(f"{count} {name}" for name, count in autopilots.items()),
        wrong="".join(wrong),
        table="\n".join(table(flown)),
    )


def main() -> int:
    options = arguments()
    known = cases()
    if options.only is not None:
        _, ended = fly(known[options.only])
        print(ended)
        return 1 if ended.wrong else 0
    begun_s = time.monotonic()
    flown = []
    for case, ended in fly_all(known if options.all else known[::STRIDE], options.processes):
        flown.append((case, ended))
        if ended.wrong:
            print(
                f"{case.seed} {case.autopilot}: {ended.injected}: {'; '.join(ended.wrong)} ({ended.reason})", flush=True
            )
    flown.sort(key=lambda each: each[0].seed)
    wrong = sum(bool(each.wrong) for _, each in flown)
    print(f"{len(flown)} runs over hostile links in {time.monotonic() - begun_s:.0f} s, {wrong} failed")
    if options.out:
        (options.out / "hostile-links.md").write_text(page(flown), encoding="utf-8")
    return 1 if wrong else 0


_PAGE: Final = """\
# Trials over hostile links

    ./dev exec python -m bench.hostile --all --out docs
    ./dev exec python -m bench.hostile --only 117

Whole trials of [real-flight.md](real-flight.md) with one hazard each. In most of them the vehicle is sound and the link
delivers something false:

- values that are not numbers, in each field; the wrong value of a parameter; an altitude that is suddenly shifted;
- messages of another component, which may pose as the autopilot;
- a second vehicle with the same ids, whose clock is ahead by the time in the table, on the ground or flying beside it
  (`flying twin`), or answering in its place (`replaced`); positions that show the ground after a gap;
- packets that are late, later and later, lost, duplicated, or from the future; commands that arrive late;
- positions whose time is ahead or behind, one or all of them, and the vehicle's clock returning to 0 after 2³² ms;
- a packet from another port, and the vehicle's own change of port;
- a false heartbeat or position in the vehicle's name, once or every second;
- no messages of one kind;
- a second source of altitude that jumps, freezes, falls silent or sends values that are not numbers.

In the others the link is honest, and something happens to the vehicle: a pilot takes over, permanently or for some
seconds; it receives nothing (`deaf`); wind carries it away; another ground station stops its motors; it flies home by
itself; its altitude drifts or is stuck, with and without a report of its landing; its attitude oscillates; it restarts,
also with a flight plan that another ground station hurries past its ground reference (`geo init ended early`).
Or Gainline's own process is killed (`process killed`, the flight is lost), and another one connects 3 s later.

Each hazard begins once in each state of a trial in which it applies and stays, and once in each state in the air for a
second and a half, under each autopilot that it concerns. As in [faults.md](faults.md) the trials run in lockstep, so a
repeated run gives the same result.

The checks use the packets at the vehicle's antenna, its true height, and the hazard itself. These are violations:

- motors off above 0.15 m; a height of more than a metre above the altitude limit;
- a vehicle that is not on the ground a minute after its trial, while Gainline attends to it; one that is armed and
  heard and stays up for eight seconds without Land, or fifteen after the process was killed; anything but Land sent
  to a vehicle in the air after its trial;
- anything sent to a vehicle that a pilot flies, once two heartbeats must have shown it. From then on the pilot is
  responsible, also after switching back, so the landing is not checked;
- a vehicle taken from a pilot whom a heartbeat has shown;
- a vehicle reported as *safe* that is armed, fell or holds other gains; no concern reported about one that is armed or
  in the air;
- a trial reported as *not flown* that left the ground; one reported as *completed* that was aborted, or that met a
  hazard which must end it;
- a failure that is not the hazard's (the numbers of [real-flight.md](real-flight.md#failures-and-reactions); *failures*
  in the table); an abort counted against the gains for something else; an unnecessary refusal or quarantine
  (`bench/hazards/hostile_table.py` lists the permitted consequences of each hazard);
- a valid record that is incomplete, or differs from the true height by more than 0.35 m; one of a vehicle that hovered
  more than 0.35 m from 3 m above the true ground.

{right} of {runs} runs ({autopilots}) passed.{wrong}

{table}

Not covered: a sender who knows the vehicle's next sequence number and continuously sends in its name. On a link that is
not signed, such a sender cannot be distinguished from the vehicle.
"""


if __name__ == "__main__":
    sys.exit(main())
