"""How often the truth lies in the 90 % intervals of what a log tells of its vehicle.

    ./dev exec python -m bench.intervals                    a few vehicles of each kind of log, against limits
    ./dev exec python -m bench.intervals --vehicles 200     the figures of docs/benchmarks.md

Random vehicles with more physics than the models fly default gains, and their logs are written as files of each kind
and read again as in `gainline analyze`. The interval of a parameter is its mean ± 1.645 of its standard deviations, as
the answer states both; what is true is said where the logs are made (bench/copters/made_logs.py,
bench/targets/made_takeoffs.py). The search for gains is left out: it takes seconds, and comes after. Exits with 1
beyond the limits, which are loose because the vehicles are few.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from typing import Final

import numpy as np

from app.autopilots.log_readers import reader_of
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.vehicle_fit import fit_copter
from app.core.errors import TrajectoryError
from app.core.tuning.logged_takeoffs import analyze_takeoffs
from app.log_library.takeoffs import logged_takeoffs
from app.logs.base import HEAD_BYTES
from bench.copters import made_logs
from bench.copters.made_logs import MadeLog
from bench.targets.made_takeoffs import ground_log

SEED: Final = 20261204
QUICK_VEHICLES: Final = 8
LIMITS: Final = (0.6, 1.0)
"""Least and largest share of all parameters of a kind that may lie in their intervals."""
_NINE_OF_TEN: Final = 1.645


@dataclass(frozen=True, slots=True)
class Estimated:
    """A parameter as it is, as the log tells it, and the standard deviation that it states."""

    truth: float
    value: float
    deviation: float

    @property
    def is_inside(self) -> bool:
        """Whether the interval contains the truth."""
        return abs(self.value - self.truth) <= _NINE_OF_TEN * self.deviation

    @property
    def width(self) -> float:
        """Width of the interval."""
        return 2.0 * _NINE_OF_TEN * self.deviation


def _of_copters(make: Callable[[np.random.Generator], MadeLog], number: int) -> MadeLog:
    return make(np.random.default_rng((SEED, number)))


KINDS: Final[Mapping[str, Callable[[int], MadeLog]]] = {
    "ArduCopter's .bin": partial(_of_copters, made_logs.dataflash),
    "ArduCopter 4.1's .bin": partial(_of_copters, made_logs.dataflash_of_4_1),
    "ArduCopter 3.6's .bin": partial(_of_copters, made_logs.dataflash_of_3_6),
    "ArduCopter's .tlog": partial(_of_copters, made_logs.telemetry_of_ardupilot),
    "PX4's .ulg": partial(_of_copters, made_logs.ulog),
    "PX4 1.9's .ulg": partial(_of_copters, made_logs.ulog_of_1_9),
    "PX4's .tlog": partial(_of_copters, made_logs.telemetry_of_px4),
    "Paparazzi's .data": ground_log,
}
"""Kinds of logs: what makes the one of the vehicle with a number from 0."""


def judge(number: int, *, kind: str) -> dict[str, Estimated] | None:
    """The parameters of a vehicle by name; None if its log is refused."""
    log = KINDS[kind](number)
    try:
        found = estimate(log)
    except TrajectoryError:
        return None
    return {name: Estimated(log.truth[name], *each) for name, each in found.items()}


def estimate(log: MadeLog) -> dict[str, tuple[float, float]]:
    """What the log tells of each parameter, and its standard deviation. Raises TrajectoryError if it tells nothing."""
    reader = reader_of(log.content[:HEAD_BYTES])
    assert reader is not None
    recording = reader.read(BytesIO(log.content), None if log.companion is None else BytesIO(log.companion))
    flown = reader.flown(reader.vehicle(recording, "The log"), "The log")
    if isinstance(flown, LoggedFlight):
        found = fit_copter(flown)
        return {name: (getattr(found.mean, name), getattr(found.deviation, name)) for name in log.truth}
    fitted = analyze_takeoffs(logged_takeoffs(flown, name="The log")).fitted
    return {each.name: (each.value, each.standard_error) for each in fitted}


def shares(judged: Sequence[Mapping[str, Estimated]]) -> dict[str, float]:
    """Share of the vehicles whose truth is inside, for each parameter."""
    return {name: float(np.mean([each[name].is_inside for each in judged])) for name in judged[0]}


def measure(kind: str, count: int, processes: int) -> bool:
    """Judge vehicles by logs of a kind, print a line for each parameter; whether the limits hold."""
    with ProcessPoolExecutor(processes) as pool:
        judged = [each for each in pool.map(partial(judge, kind=kind), range(count), chunksize=8) if each is not None]
    print(f"\n{kind}: {len(judged)} of {count} logs answered", flush=True)
    if not judged:
        return False
    inside = shares(judged)
    for name, share in inside.items():
        width = float(np.median([each[name].width for each in judged]))
        error = float(np.median([abs(each[name].value - each[name].truth) for each in judged]))
        print(f"    {name:20} inside {share:.0%}; medians: width {width:.4f}, error {error:.4f}")
    whole = float(np.mean([*inside.values()]))
    print(f"    all parameters inside {whole:.0%} (limits {LIMITS[0]:.0%} … {LIMITS[1]:.0%})")
    return LIMITS[0] <= whole <= LIMITS[1]


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.intervals")
    parser.add_argument("--vehicles", type=int, default=QUICK_VEHICLES)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--kind", choices=[*KINDS], default=None)
    chosen = parser.parse_args()
    kinds = [chosen.kind] if chosen.kind else list(KINDS)
    passed = [measure(kind, chosen.vehicles, chosen.processes) for kind in kinds]
    return int(not all(passed))


if __name__ == "__main__":
    sys.exit(main())
