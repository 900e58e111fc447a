"""Summary and document of the results of many runs."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, TypedDict, cast

from bench.hazards.cases import FAULT_KINDS
from bench.hazards.results import Line
from bench.hazards.trial_states import State

OUTCOMES: Final = ("completed", "aborted", "invalid", "refused")
VEHICLE_STATES: Final = ("safe", "quarantined", "unopened")


class _InjectedFault(TypedDict):
    kind: str
    state: str


def summary(lines: Sequence[Line]) -> str:
    """Return the summary, with the seeds and violations of failed runs."""
    wrong = [line for line in lines if line["wrong"]]
    return "\n".join(
        (
            f"{len(lines)} runs, {len(lines) - len(wrong)} passed",
            *(f"  {line['seed']} {line['autopilot']}: {'; '.join(_wrong(line))}" for line in wrong),
            f"vehicles afterwards: {_counts(lines, 'vehicle', VEHICLE_STATES)}",
            f"packets that stop motors: {_total(lines, 'stopping_packets')}, the highest at {_highest(lines):.2f} m",
        )
    )


def page(lines: Sequence[Line]) -> str:
    """Return the text of docs/faults.md."""
    return _PAGE.format(
        seeds=f"{lines[0]['seed']} … {lines[-1]['seed']}",
        first=lines[0]["seed"],
        runs=len(lines),
        right=sum(not line["wrong"] for line in lines),
        autopilots=_counts(lines, "autopilot", ("paparazzi", "ardupilot", "px4")),
        outcomes=_counts(lines, "outcome", OUTCOMES),
        vehicles=_counts(lines, "vehicle", VEHICLE_STATES),
        stops=_total(lines, "stopping_packets"),
        highest=f"{_highest(lines):.2f}",
        wrong="".join(f"\n- {line['seed']}: {'; '.join(_wrong(line))}" for line in lines if line["wrong"]),
        where="\n".join(_where(lines)),
        ends="\n".join(_ends(lines)),
    )


def _where(lines: Sequence[Line]) -> Iterator[str]:
    """Yield the table of how often each fault began in each state."""
    counted = Counter((each["kind"], each["state"]) for line in lines for each in _injected(line))
    wrong = Counter((each["kind"], each["state"]) for line in lines if line["wrong"] for each in _injected(line))
    yield from _header("fault", [str(state) for state in State])
    for kind in FAULT_KINDS:
        cells = [(counted[kind, state], wrong[kind, state]) for state in State]
        yield _row(kind, [f"{count}{f' ({bad} wrong)' if bad else ''}" if count else "" for count, bad in cells])


def _ends(lines: Sequence[Line]) -> Iterator[str]:
    """Yield the table of the outcomes of runs with a single kind of fault."""
    yield from _header("only fault", [*OUTCOMES, *VEHICLE_STATES])
    for kind in FAULT_KINDS:
        alone = [line for line in lines if {each["kind"] for each in _injected(line)} == {kind}]
        counts = [sum(line.get("outcome") == name for line in alone) for name in OUTCOMES]
        counts += [sum(line.get("vehicle") == name for line in alone) for name in VEHICLE_STATES]
        yield _row(kind, [str(count or "") for count in counts])


def _header(first: str, columns: Sequence[str]) -> Iterator[str]:
    yield _row(first, columns)
    yield _row("---", ["---"] * len(columns))


def _row(first: str, cells: Sequence[str]) -> str:
    return f"| {first} | {' | '.join(cells)} |"


def _injected(line: Line) -> list[_InjectedFault]:
    return cast("list[_InjectedFault]", line.get("injected", []))


def _wrong(line: Line) -> list[str]:
    return cast("list[str]", line["wrong"])


def _counts(lines: Sequence[Line], field: str, names: Sequence[str]) -> str:
    counted: Mapping[object, int] = Counter(line.get(field) for line in lines)
    return ", ".join(f"{counted.get(name, 0)} {name}" for name in names)


def _total(lines: Sequence[Line], field: str) -> int:
    return sum(cast("int", line.get(field, 0)) for line in lines)


def _highest(lines: Sequence[Line]) -> float:
    """Return the greatest height at which motors off was sent, without the operator's own."""
    return max((cast("float", line.get("highest_stop_m", 0.0)) for line in lines), default=0.0)


_PAGE: Final = """\
# Trials with faults

    ./dev exec python -m bench.faults --runs {runs} --seed {first}
    ./dev exec python -m bench.faults --only {first}

Whole trials of [real-flight.md](real-flight.md), each with one or two faults: a fault of the simulated drone
([sim-drone.md](sim-drone.md)), an operator who aborts or stops the motors, another ground station that interferes, or
gains that do not fly. The first command without arguments, as in `.ci/run`, flies a sample of 20; `--only SEED` repeats
one run and prints all details. `--out docs` writes this page.

The seed of a run determines the autopilot, the gains, the faults, the state of the trial in which each begins, how long
after the beginning of that state, and its duration (from a tenth of a second to permanent). Consecutive seeds cover
every fault in every state. The vehicle is the simulated drone with the flight model `twin` and its scatter; Gainline
flies it with `MavlinkVehicle`, as any vehicle over MAVLink. Both run in lockstep: the drone's time advances only while
Gainline waits, so a repeated run gives the same result however busy the machine is. Real sockets and threads are
covered by the tests of the link.

The checks (`bench/hazards/fault_checks.py`) were written from the table in real-flight.md and do not use Gainline's
own account of the trial. A tap at the drone's antenna reads every packet that the ground sends, whether or not the
drone receives it, together with the drone's true height. The states in the tables below are derived from these packets.
The checks are:

- Is the outcome of the trial the one that the table requires for the fault, its beginning and its duration?
- Did the drone truly never rise, by more than 2 mm, in a trial in which nothing is reported as flown (*refused*)?
- Is the drone truly disarmed on the ground with its safe gains, or quarantined for a reason that the table names? A
  vehicle reported as safe must be safe, and an unnecessary quarantine is a violation too.
- Was no packet that stops motors sent while the drone was more than 0.15 m above the ground, except by the operator?
- Did the drone take off with the gains that were read back?
- Were Land and the safe gains sent in the order that the table requires, and was Land repeated while the link was lost?
- Was no set point sent after the flight had ended, for whatever reason? Half of the trials fly altitude steps after
  their takeoff, PX4 in offboard mode.
- Was nothing commanded to a vehicle of which a heartbeat had shown that a pilot flies it, and offboard mode never
  requested from a pilot, except in the 0.15 s after the takeover?
- Was nothing sent before a heartbeat was received?
- Were all time limits kept: the record, 40 s to land, 5 s to disarm, 60 s without a link?

## Result

{right} of {runs} runs (seeds {seeds}; {autopilots}) passed.{wrong}

- Trials: {outcomes}.
- Vehicles afterwards: {vehicles} (an unopened vehicle could not be connected, so Gainline never controlled it).
- {stops} packets that stop motors were sent. Apart from the operator's own, none was sent with the drone more than
  {highest} m above the ground.

Number of runs in which each fault began in each state:

{where}

- `other-mode` and `other-landing`: another ground station changes the mode, or commands Land.
- `other-target` and `other-gain`: another ground station sends a set point, or writes a gain. Under Paparazzi a set
  point that another ground station moves is not reported, and the flight may count.
- `stall`: Gainline's process stands still, for up to 3 s in flight.
- `taken-over`: a pilot switches to a manual mode, and back at the end.
- `motors-off`: the operator stops the motors.
- `wild-gains`: the gains of the trial do not fly.
- `silent-witness`: what the autopilot itself reports of its landing is not received.
- `foreign-kill`: another ground station stops the motors. `flies-home`: the drone flies home by itself.
- `stuck-altitude`, `drifting-altitude`, `creeping-altitude`: altitude and climb rate agree with each other, and are
  wrong. A Paparazzi has no other source that could show it in flight, so the flight may count against its gains.
- `lean-oscillation`: the attitude oscillates, with a standard deviation of 28°.
- `mocap-…`: faults of a second source of altitude, which only these trials have.

Outcomes of runs with a single kind of fault:

{ends}

## Defects found

These were found by such runs and have been fixed. `tests/bench/test_faults.py` flies them again.

- A stop or a refusal between staging and arming left the trial's gains on the vehicle until the connection was closed.
- An autopilot that restarted while gains were staged flew with its own gains, and the record was attributed to the
  staged ones.
- With single position samples that jump, a vehicle on the ground was never at rest for two seconds and was quarantined
  after 40 s.
- When gains overshot to the altitude limit of the vehicle's own flight plan, Gainline took the landing for one that
  the vehicle had begun for another reason. It landed with these gains, and the flight did not count against them.
- When the link was lost during lift-off, Gainline took this for no lift-off and counted it against the gains.
- A pilot who had taken over a PX4 less than a second before it was to follow set points was overridden once.
- An ArduCopter that followed the set point of another ground station counted as flown to Gainline's.
- A flight in which another ground station wrote a gain counted for the staged gains; if it did so between arming and
  takeoff, the vehicle took off.
- When Gainline's process stood still for more than a second, its own silence could be taken for the vehicle's.

Not covered: sideways movement, radios that lose single packets, other autopilots, and hardware. Trials in which the
link delivers false messages of a sound vehicle are in [hostile-links.md](hostile-links.md).
"""
