"""Whole trials in lockstep over a hostile link, or with a vehicle that something befalls: what may never be seen.

    ./dev exec python -m bench.hostile                          a sample, as .ci/run has it
    ./dev exec python -m bench.hostile --all --out docs         every hazard, from every state on, three autopilots
    ./dev exec python -m bench.hostile --only 117               one run again

Prints what went wrong and a table; with `--out` writes hostile-links.md there. Exits 1 when a single run is not as it
must be.
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
from bench.hazards.hostile import Ended, carry_out, cases
from bench.hazards.hostility import HAZARDS

STRIDE: Final = 37
"""Of the sample: from each case to the next another hazard, another state, in the end another autopilot."""
VERDICTS: Final = ("completed", "aborted", "invalid", "refused")
LEFT: Final = ("safe", "quarantined", "unopened")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bench.hostile")
    parser.add_argument("--all", action="store_true", help="every case, not a sample")
    parser.add_argument("--only", type=int, metavar="SEED", help="this run alone")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="folder for hostile-links.md")
    return parser.parse_args()


def fly(case: Case) -> tuple[Case, Ended]:
    try:
        return case, carry_out(case)
    except Exception as error:  # noqa: BLE001 - a run that breaks is a failed one
        why = f"the run broke: {type(error).__name__}: {error}"
        return case, Ended("", "", "", str(case.mishaps[0]), (why,))


def fly_all(chosen: Sequence[Case], processes: int) -> Iterator[tuple[Case, Ended]]:
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        yield from pool.imap_unordered(fly, chosen)


def table(flown: Sequence[tuple[Case, Ended]]) -> Iterator[str]:
    yield f"| what befalls it | runs | {' | '.join((*VERDICTS, *LEFT))} | wrong |"
    yield "| --- |" + " --- |" * (len(VERDICTS) + len(LEFT) + 2)
    for name in HAZARDS:
        ended = [each for case, each in flown if case.mishaps[0].kind == name]
        verdicts, left = Counter(each.outcome for each in ended), Counter(each.vehicle for each in ended)
        counts = [*(verdicts[each] for each in VERDICTS), *(left[each] for each in LEFT)]
        cells = " | ".join(str(count or "") for count in (len(ended), *counts, sum(bool(each.wrong) for each in ended)))
        yield f"| {name} | {cells} |"


def page(flown: Sequence[tuple[Case, Ended]]) -> str:
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
                f"{case.seed} {case.autopilot}: {ended.struck}: {'; '.join(ended.wrong)} ({ended.reason})", flush=True
            )
    flown.sort(key=lambda each: each[0].seed)
    wrong = sum(bool(each.wrong) for _, each in flown)
    print(f"{len(flown)} runs over hostile links in {time.monotonic() - begun_s:.0f} s, {wrong} not as they must be")
    if options.out:
        (options.out / "hostile-links.md").write_text(page(flown), encoding="utf-8")
    return 1 if wrong else 0


_PAGE: Final = """\
# Trials over hostile links

    ./dev exec python -m bench.hostile --all --out docs
    ./dev exec python -m bench.hostile --only 117

Whole trials of [real-flight.md](real-flight.md) with a sound vehicle and a link that tells what it likes: values that
are no numbers, in each field; another component, as it is or posing as the autopilot; a second vehicle with the same
ids, whose clock is so much older; packets late, twice, or from the future; a heartbeat or a position in the vehicle's
name, once or every second; one kind of message that does not come; the wrong echo of a parameter; an altitude that is
suddenly a little other; a second source of altitude that jumps, freezes, falls silent or tells no numbers. Or an honest
link, and a vehicle that something befalls: a pilot who takes it over, for good or for some seconds; deafness; wind.
Each sets in in each state of a trial for good, and in the air for a second and a half, under each autopilot. The rig is
that of [faults.md](faults.md): lockstep, so a run that is flown again is the same.

What may never be, read from the packets at the vehicle's antenna, its true height, and what truly befell it:

- its motors told to stop above 0.15 m; a height of more than a metre over the limit of altitude;
- a vehicle that is not on the ground a minute after its trial, the program attending to it, or that was up for eight
  seconds then, armed and heard, without sinking and without Land; anything but Land sent to it;
- anything sent to a vehicle that a pilot flies, once two heartbeats must have told so (it is theirs from then on, also
  when they switch back: whether they bring it down is not looked at); one taken from a pilot whom a heartbeat told of;
- *safe* said of one that is armed or holds other gains; nothing said of one that is armed or in the air;
- a trial *not flown* that left the ground; *completed* that was aborted, or met what is not tolerated; a reason that
  does not name what befell it; gains blamed for what is not theirs; a quarantine without need
  (`bench/hazards/expectations.py` says what each may do);
- a record that counts, and is not whole, or more than 0.35 m from where the vehicle was.

{right} of {runs} runs ({autopilots}) were as they must be.{wrong}

{table}

What the runs do not have: somebody who knows the vehicle's next sequence number and speaks in its stead for good. Where
the link is not signed, nothing tells that one from the vehicle.
"""


if __name__ == "__main__":
    sys.exit(main())
