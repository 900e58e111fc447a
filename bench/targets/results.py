"""Results on disk, one JSON line each, and the processes that compute those that are missing."""

import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final, TypeVar

from bench.targets.flying import Tuning, tune
from bench.targets.methods import DISTRIBUTIONS, METHODS
from bench.targets.vehicles import SampledVehicle, own_optimum

OPTIMUM: Final = "optimum"
"""Task that finds a vehicle's own best gains."""

Record = Mapping[str, object]

_Vehicle = TypeVar("_Vehicle")


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One method on one vehicle, or the vehicle's own optimum."""

    population: str
    number: int
    seed: int
    what: str


class Results:
    """File of results. A line truncated by an interruption is dropped."""

    def __init__(self, file: Path) -> None:
        self._file = file
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
        whole, _, cut_off = text.rpartition("\n")
        if cut_off:
            file.write_text(f"{whole}\n" if whole else "", encoding="utf-8")
        self._kept: dict[Task, Record] = {}
        for line in whole.splitlines():
            record = json.loads(line)
            self._kept[Task(**record["task"])] = record

    def __contains__(self, task: Task) -> bool:
        return task in self._kept

    def __getitem__(self, task: Task) -> Record:
        return self._kept[task]

    def __iter__(self) -> Iterator[Task]:
        return iter(self._kept)

    def add(self, task: Task, record: Record) -> None:
        """Store a result, on disk first."""
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"task": asdict(task), **record}, separators=(",", ":")) + "\n")
        self._kept[task] = record


def carry_out(task: Task, vehicle: SampledVehicle, budget: int | None = None) -> Record:
    """Run one task; `budget` limits the method's number of flights."""
    made = {"day": datetime.now(UTC).date().isoformat()}
    if task.what == OPTIMUM:
        optimum = own_optimum(vehicle)
        return {"made": made, "gains": list(optimum.gains.values()), "error": optimum.error}
    method = METHODS[task.what]
    flights = min(method.budget, budget or method.budget)
    tuning = Tuning(vehicle=vehicle, seed=task.seed, budget=flights, recommends_last=method.recommends_last)
    libraries = {DISTRIBUTIONS[name]: version(DISTRIBUTIONS[name]) for name in method.needs}
    return {"made": {**made, **libraries}, "budget": flights, **tune(method.run, tuning)}


def work(
    tasks: Iterable[tuple[Task, _Vehicle]],
    results: Results,
    *,
    processes: int,
    carry_out: Callable[[Task, _Vehicle], Record],
) -> Iterator[Task]:
    """Run the missing tasks in single-threaded processes of low priority; yield each task once it is stored."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context, initializer=os.nice, initargs=(10,)) as pool:
        waiting = {pool.submit(carry_out, task, vehicle): task for task, vehicle in tasks if task not in results}
        for done in as_completed(waiting):
            results.add(waiting[done], done.result())
            yield waiting[done]
