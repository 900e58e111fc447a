"""The results of many runs as text."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, TypedDict, cast

from bench.hazards.cases import MISHAPS
from bench.hazards.results import Line
from bench.hazards.stages import Stage

OUTCOMES: Final = ("completed", "aborted", "invalid", "refused")
VEHICLE: Final = ("safe", "quarantined", "unopened")


class _Struck(TypedDict):
    kind: str
    stage: str


def summary(lines: Sequence[Line]) -> str:
    """The summary, and the seeds of what went wrong."""
    wrong = [line for line in lines if line["wrong"]]
    return "\n".join(
        (
            f"{len(lines)} runs, {len(lines) - len(wrong)} as asked",
            *(f"  {line['seed']} {line['autopilot']}: {'; '.join(_wrong(line))}" for line in wrong),
            f"afterwards: {_counts(lines, 'vehicle', VEHICLE)}",
            f"packets that stop motors: {_total(lines, 'stopping_packets')}, the highest at {_highest(lines):.2f} m",
        )
    )


def page(lines: Sequence[Line]) -> str:
    """docs/faults.md."""
    return _PAGE.format(
        seeds=f"{lines[0]['seed']} … {lines[-1]['seed']}",
        first=lines[0]["seed"],
        runs=len(lines),
        right=sum(not line["wrong"] for line in lines),
        autopilots=_counts(lines, "autopilot", ("paparazzi", "ardupilot", "px4")),
        outcomes=_counts(lines, "outcome", OUTCOMES),
        vehicles=_counts(lines, "vehicle", VEHICLE),
        stops=_total(lines, "stopping_packets"),
        highest=f"{_highest(lines):.2f}",
        wrong="".join(f"\n- {line['seed']}: {'; '.join(_wrong(line))}" for line in lines if line["wrong"]),
        where="\n".join(_where(lines)),
        ends="\n".join(_ends(lines)),
    )


def _where(lines: Sequence[Line]) -> Iterator[str]:
    """How often each mishap set in in each state."""
    counted = Counter((each["kind"], each["stage"]) for line in lines for each in _struck(line))
    wrong = Counter((each["kind"], each["stage"]) for line in lines if line["wrong"] for each in _struck(line))
    yield from _header("what sets in", [str(stage) for stage in Stage])
    for kind in MISHAPS:
        cells = [(counted[kind, stage], wrong[kind, stage]) for stage in Stage]
        yield _row(kind, [f"{count}{f' ({bad} wrong)' if bad else ''}" if count else "" for count, bad in cells])


def _ends(lines: Sequence[Line]) -> Iterator[str]:
    """Outcomes of runs in which nothing else set in."""
    yield from _header("what set in, alone", [*OUTCOMES, *VEHICLE])
    for kind in MISHAPS:
        alone = [line for line in lines if {each["kind"] for each in _struck(line)} == {kind}]
        counts = [sum(line.get("outcome") == name for line in alone) for name in OUTCOMES]
        counts += [sum(line.get("vehicle") == name for line in alone) for name in VEHICLE]
        yield _row(kind, [str(count or "") for count in counts])


def _header(first: str, columns: Sequence[str]) -> Iterator[str]:
    yield _row(first, columns)
    yield _row("---", ["---"] * len(columns))


def _row(first: str, cells: Sequence[str]) -> str:
    return f"| {first} | {' | '.join(cells)} |"


def _struck(line: Line) -> list[_Struck]:
    return cast("list[_Struck]", line.get("struck", []))


def _wrong(line: Line) -> list[str]:
    return cast("list[str]", line["wrong"])


def _counts(lines: Sequence[Line], field: str, names: Sequence[str]) -> str:
    counted: Mapping[object, int] = Counter(line.get(field) for line in lines)
    return ", ".join(f"{counted.get(name, 0)} {name}" for name in names)


def _total(lines: Sequence[Line], field: str) -> int:
    return sum(cast("int", line.get(field, 0)) for line in lines)


def _highest(lines: Sequence[Line]) -> float:
    """Of the packets that stop motors, without those of the operator's own act."""
    return max((cast("float", line.get("highest_stop_m", 0.0)) for line in lines), default=0.0)


_PAGE: Final = """\
# Trials with faults

    ./dev exec python -m bench.faults --runs {runs} --seed {first}
    ./dev exec python -m bench.faults --only {first}

Whole trials of [real-flight.md](real-flight.md), each with one or two things wrong: the simulated drone's faults
([sim-drone.md](sim-drone.md)), an operator who aborts or stops the motors, another ground station that interferes,
gains that do not fly. Without arguments, as `.ci/run` has it, the first command flies a sample of 20; `--only SEED`
flies one run again and prints all that is known of it. This page is written by `--out docs`.

A run is drawn from its seed: autopilot, gains, what sets in, in which state of the trial, how long after its
beginning and for how long (a fifth of a second to for good). Consecutive seeds go through everything in every state.
The vehicle is the simulated drone in the body of `twin` with its scatter; the program is `MavlinkVehicle` as it flies.
They are in lockstep: the drone's time passes only while the program waits, so a run that is flown again is the same,
whatever else the machine does. Real sockets and threads are for the tests of the link.

What the program does is judged without asking it. A tap at the drone's antenna reads every packet that the ground
sends, whether the drone hears it or not, and knows the drone's true height at that moment. The states in the tables
are told from these packets. Afterwards the judgement (`bench/hazards/expected.py`, written from the table in
real-flight.md) asks:

- Is the trial worth what the table says for what set in, when it did, and for how long it lasted?
- Does the drone truly hold its safe gains, disarmed on the ground? Or was it quarantined, for a reason that the table
  knows? A program that says “safe” must be right, and quarantine without need is wrong too.
- Did no packet that stops motors leave while the drone was more than 0.15 m above the ground, but for the operator's
  separate act?
- Did it take off on other gains than those that were read back? Was Land sent first, or the safe gains, as the table
  has it; was Land repeated every second while the link was lost; was anything sent before a heartbeat was heard?
- Was every limit of time kept: the record, 40 s to land, 5 s to disarm, 60 s without a link?

## Result

{right} of {runs} runs (seeds {seeds}; {autopilots}) ended as asked.{wrong}

- The trials: {outcomes}.
- The vehicles afterwards: {vehicles} (the program never had control of one that could not be opened).
- {stops} packets that stop motors were sent; but for those of the operator's own act, none with the drone higher than
  {highest} m above the ground.

How often each mishap set in in each state:

{where}

`other-mode` and `other-landing` are another ground station's; `motors-off` is the operator's separate act; with
`wild-gains` the gains of the trial do not fly; `mocap-…` are faults of a second source of altitude, which only these
trials have.

Outcomes of runs in which nothing else set in:

{ends}

## What such runs found

All of it was mended, and is flown again by `tests/bench/test_faults.py`:

- A stop or a refusal between the staging of the gains and arming left these gains on the vehicle until it was closed.
- An autopilot that restarted while gains were staged was flown on its own; the record was taken for the staged ones'.
- With a position that jumps now and then, a vehicle on the ground was never at rest for two seconds: it was quarantined
  after 40 s.
- Gains that overshoot to the ceiling of the vehicle's own flight plan passed for a landing that the vehicle began by
  itself: it was landed on these gains, and nothing was learnt of them.
- A lift-off that could not be seen, because the link was lost at that moment, passed for none, and the gains were
  blamed for it.

What the runs do not have: sideways movement, radios that lose single packets, autopilots of other makes, hardware.
What a link may say of a sound vehicle is in [hostile-links.md](hostile-links.md).
"""
