"""The results of runs as lines of JSON, and the pool of processes that computes them."""

import json
import multiprocessing
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from bench.hazards.cases import MOTORS_OFF, Case, draw
from bench.hazards.fault_checks import find_violations
from bench.hazards.fault_trial import TrialResult, run_trial

LONGEST_RUN_S = 180.0
"""Wall-clock time after which a run counts as hanging."""

Line = Mapping[str, object]


def fly(seed: int) -> Line:
    """Fly the case of a seed and return its line, with the violations found."""
    return fly_case(draw(seed))


def fly_case(case: Case) -> Line:
    begun_s = time.monotonic()
    try:
        result = run_trial(case)
    except Exception as error:  # noqa: BLE001 - a run that raises has failed
        return _line(case) | {"wrong": [f"the run raised {type(error).__name__}: {error}"]}
    outcome = {
        "outcome": result.outcome,
        "vehicle": result.vehicle,
        "reason": result.reason,
        "holds_safe": result.holds_safe,
        "held": dict(result.held),
        "armed": result.armed,
        "height_m": round(result.height_m, 3),
        "states": [[state, round(since_s, 3)] for state, since_s in result.states.entered],
        "ended_s": round(result.states.ended_s, 3),
        "injected": [_rounded(asdict(each)) for each in result.injected],
        "stopping_packets": len(result.stops),
        "highest_stop_m": round(highest_m(result), 3),
        "wrong": find_violations(case, result),
        "wall_s": round(time.monotonic() - begun_s, 1),
    }
    return _line(case) | outcome


def highest_m(result: TrialResult) -> float:
    """Return the greatest height at which the program sent motors off, before the operator did."""
    acted_s = min((each.begun_s for each in result.injected if each.kind == MOTORS_OFF), default=float("inf"))
    return max((stop.height_m for stop in result.stops if stop.at_s < acted_s), default=0.0)


def _line(case: Case) -> dict[str, object]:
    return {
        "seed": case.seed,
        "autopilot": case.autopilot,
        "flies_steps": case.flies_steps,
        "faults": [_rounded(asdict(each)) for each in case.faults],
        "gains": dict(case.gains),
        "safe": dict(case.safe),
    }


def _rounded(fields: Mapping[str, object]) -> dict[str, object]:
    """Round the numbers; infinite times become null, because JSON has no infinity."""
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
    """Yield the line of every run as it ends. A run that hangs is ended and reported as a failure."""
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
                _assign(worker, waiting.pop())
            else:
                _end(worker)
                workers.remove(worker)


def _answer(worker: _Worker, *, is_ready: bool) -> Line | None:
    """Return the line of the worker's run, None while it is running."""
    if is_ready:
        try:
            line: Line = worker.pipe.recv()
        except EOFError:
            return _line(draw(worker.seed)) | {"wrong": ["the process of the run ended without a result"]}
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
    _assign(worker, seed)
    return worker


def _assign(worker: _Worker, seed: int) -> None:
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
