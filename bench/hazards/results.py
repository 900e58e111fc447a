"""What is kept of every run, a line of JSON each, and the pool of processes that fly them."""

import json
import multiprocessing
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from bench.hazards.cases import MOTORS_OFF, Case, draw
from bench.hazards.expected import faults
from bench.hazards.flying import Flown, carry_out

LONGEST_RUN_S = 180.0
"""On the wall; a run that takes longer hangs."""

Line = Mapping[str, object]


def fly(seed: int) -> Line:
    """The run of a seed, judged."""
    return fly_case(draw(seed))


def fly_case(case: Case) -> Line:
    begun_s = time.monotonic()
    try:
        flown = carry_out(case)
    except Exception as error:  # noqa: BLE001 - a run that breaks is a failed one
        return _line(case) | {"wrong": [f"the run broke: {type(error).__name__}: {error}"]}
    told = {
        "outcome": flown.outcome,
        "vehicle": flown.vehicle,
        "reason": flown.reason,
        "holds_safe": flown.holds_safe,
        "held": dict(flown.held),
        "armed": flown.armed,
        "height_m": round(flown.height_m, 3),
        "states": [[stage, round(since_s, 3)] for stage, since_s in flown.stages.entered],
        "over_s": round(flown.stages.over_s, 3),
        "struck": [_rounded(asdict(each)) for each in flown.struck],
        "stopping_packets": len(flown.stops),
        "highest_stop_m": round(highest_m(flown), 3),
        "wrong": faults(case, flown),
        "wall_s": round(time.monotonic() - begun_s, 1),
    }
    return _line(case) | told


def highest_m(flown: Flown) -> float:
    """At what height the program told the motors to stop, before a person did."""
    acted_s = min((each.begun_s for each in flown.struck if each.kind == MOTORS_OFF), default=float("inf"))
    return max((stop.height_m for stop in flown.stops if stop.at_s < acted_s), default=0.0)


def _line(case: Case) -> dict[str, object]:
    return {
        "seed": case.seed,
        "autopilot": case.autopilot,
        "mishaps": [_rounded(asdict(each)) for each in case.mishaps],
        "gains": dict(case.gains),
        "safe": dict(case.safe),
    }


def _rounded(fields: Mapping[str, object]) -> dict[str, object]:
    """Infinite times as null, for JSON has none."""
    return {name: _number(value) if isinstance(value, float) else value for name, value in fields.items()}


def _number(value: float) -> float | None:
    return round(value, 3) if value < float("inf") else None


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    pipe: Connection
    seed: int
    begun_s: float


def fly_all(seeds: Sequence[int], *, processes: int) -> Iterator[Line]:
    """Every run, in the order in which they end. One that hangs is ended, and its line says so."""
    waiting = list(reversed(seeds))
    workers: list[_Worker] = []
    while waiting or workers:
        while waiting and len(workers) < processes:
            workers.append(_start(waiting.pop()))
        ready = wait([worker.pipe for worker in workers], timeout=1.0)
        for worker in tuple(workers):
            line = _answer(worker, is_ready=worker.pipe in ready)
            if line is None:
                continue
            yield line
            if waiting and "hangs" not in str(line["wrong"]) and worker.process.is_alive():
                _hand(worker, waiting.pop())
            else:
                _end(worker)
                workers.remove(worker)


def _answer(worker: _Worker, *, is_ready: bool) -> Line | None:
    """The line of its run, None while it flies."""
    if is_ready:
        try:
            line: Line = worker.pipe.recv()
        except EOFError:
            return _line(draw(worker.seed)) | {"wrong": ["the process of the run hangs up"]}
        return line
    if time.monotonic() - worker.begun_s > LONGEST_RUN_S:
        return _line(draw(worker.seed)) | {"wrong": [f"the run hangs: it was not over after {LONGEST_RUN_S:g} s"]}
    return None


def _start(seed: int) -> _Worker:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    worker = _Worker(process, ours, seed, 0.0)
    _hand(worker, seed)
    return worker


def _hand(worker: _Worker, seed: int) -> None:
    worker.seed, worker.begun_s = seed, time.monotonic()
    worker.pipe.send(seed)


def _end(worker: _Worker) -> None:
    worker.process.terminate()
    worker.process.join()
    worker.pipe.close()


def _work(pipe: Connection) -> None:
    while True:
        pipe.send(fly(pipe.recv()))


def stored(line: Line) -> str:
    return json.dumps(line)
