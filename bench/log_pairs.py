"""Whether two logs of one vehicle tell whose gains are better, on random vehicles.

    ./dev exec python -m bench.log_pairs                  a few pairs, against the limits
    ./dev exec python -m bench.log_pairs --pairs 100      the figures of docs/benchmarks.md

Each vehicle has more physics than the models (bench/copters/simulation.py) and flies twice, in weather that is drawn
anew; in a third of the pairs the second flight has weather of another strength and another manoeuvre, too. Its gains
are the same, hardly others, others by factors, or the proposed ones; either flight may be the later one. Both logs are
written as files and read again, and each flight is packed as the database has it.

The truth is the mean error of both gain sets in 40 further flights in the manoeuvre and weather of each of the two:
their difference over the scatter of a single flight, D. One set is better if one flight with it beats one with the
other in at least 19 of 20 cases, |D| ≥ 1.645·√2, and neither is if the difference is less than the scatter, |D| < 1.
Between these, whether two flights tell it is chance: the right direction and unresolved both count as told, the
opposite as wrong. The last line leaves out nothing and allows nothing: there, one set is better from the middle on,
where one flight beats the other in nine of ten cases, as a verdict claims. Exits with 1 beyond the limits.

Both logs are also fitted together from what is stored of each: how often what is true of the vehicle lies in the 90 %
intervals, what is left of the least deviation of one log, and how that compares with a fit of all their rows.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from io import BytesIO
from typing import Final

import numpy as np

from app.autopilots.log_readers import reader_of
from app.core.analysis.analysis import analyze, find_unexplained
from app.core.analysis.combined_fit import combine, log_fit
from app.core.analysis.loop import AltitudeLoop, LoggedFlight
from app.core.analysis.vehicle_fit import fit_copter
from app.core.errors import TrajectoryError
from app.core.statistics.gain_change import FlownLog, GainChange, compare_logs
from app.log_library.flights import pack_flight, unpack_flight
from app.logs.base import HEAD_BYTES
from bench.copters.made_logs import truth_of
from bench.copters.px4_simulation import fly_changes
from bench.copters.rigs import RIGS
from bench.copters.simulation import SimulatedCopter, StepFlight, fly_steps
from tests.logs.written import ardupilot_log
from tests.logs.written_px4 import PARAMETERS, px4_log

SEED: Final = 20261206
QUICK_PAIRS: Final = 10
FURTHER_FLIGHTS: Final = 40
ALIKE, CERTAIN, NINE_OF_TEN = 1.0, 1.645 * 2.0**0.5, 1.282 * 2.0**0.5
LIMITS: Final = (0.9, 0.05)
"""Least share told as the truth is, and largest share told wrong."""
_WEATHER: Final = (0.4, 2.5)
_FACTORS: Final = (0.4, 2.5)
_HARDLY: Final = (0.97, 1.03)
CHANGES: Final = ("same", "hardly", "one gain", "all gains", "all gains", "proposed", "proposed")


@dataclass(frozen=True, slots=True)
class Kind:
    """Flights under an autopilot: manoeuvres to choose from, what flies one, and what writes its log."""

    manoeuvres: Sequence[object]
    fly: Callable[..., StepFlight]
    write: Callable[[LoggedFlight], bytes]


def _px4_log(flight: LoggedFlight) -> bytes:
    return px4_log(flight, parameters={**PARAMETERS, **flight.loop.firmware_parameters})


KINDS: Final[Mapping[str, Kind]] = {
    "ArduCopter": Kind(
        ((2.0, -2.0), (4.0, -4.0), (1.0, 1.0, -2.0)),
        lambda copter, loop, manoeuvre, seed: fly_steps(copter, loop.parameters, seed=seed, changes_m=manoeuvre),
        lambda flight: ardupilot_log(flight, parameters=flight.loop.firmware_parameters),
    ),
    "PX4": Kind(
        ("auto", "offboard"),
        lambda copter, loop, manoeuvre, seed: fly_changes(copter, loop.parameters, seed=seed, manoeuvre=manoeuvre),
        _px4_log,
    ),
}


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What differs between two flights of a vehicle beside its gains: the vehicle in its weather, and a manoeuvre."""

    copter: SimulatedCopter
    manoeuvre: object


@dataclass(frozen=True, slots=True)
class Together:
    """A parameter of two logs fitted together: whether the truth is inside, what is left of the deviation, and its
    deviation and distance in deviations of the fit of all rows."""

    is_inside: bool
    remaining: float
    of_rows: float
    apart: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A pair: D as above, later − earlier, what the two logs tell, `no model` if one of the two cannot be analysed, and
    the D that they estimate; what the two measured errors alone would tell with the same scatter; and the processor
    time of the comparison, s."""

    autopilot: str
    change: str
    other_weather: bool
    truth: float
    told: str
    estimate: float
    measured: str
    is_contradicted: bool
    took_s: float
    together: Mapping[str, "Together"] = field(default_factory=dict)

    @property
    def class_(self) -> str:
        """The truth in words."""
        if abs(self.truth) < ALIKE:
            return "unresolved"
        return ("better" if self.truth < 0.0 else "worse") if abs(self.truth) >= CERTAIN else "between"

    @property
    def is_told(self) -> bool:
        """Whether what was told is the truth."""
        between = self.class_ == "between" and self.told in ("unresolved", self._direction)
        return between or self.told == self.class_

    @property
    def is_wrong(self) -> bool:
        """Whether it is the opposite, or a difference where there is none."""
        return not self.is_told and self.told in ("better", "worse")

    @property
    def is_told_strictly(self) -> bool:
        """The same with nothing between."""
        return self.told == (self._direction if abs(self.truth) >= NINE_OF_TEN else "unresolved")

    @property
    def _direction(self) -> str:
        return "better" if self.truth < 0.0 else "worse"


def judge(number: int, *, seed: int = SEED) -> Judged:
    """Fly, log and compare a pair."""
    autopilot = (*KINDS,)[number % 2]
    kind, rig, random = KINDS[autopilot], RIGS[autopilot], np.random.default_rng((seed, number))
    change = CHANGES[number // 2 % len(CHANGES)]
    copter, other_weather = rig.sample(random), number % 3 == 0
    usual = Circumstances(copter, kind.manoeuvres[0])
    other = Circumstances(
        replace(copter, gust_m_s2=copter.gust_m_s2 * _log_uniform(random, _WEATHER)),
        kind.manoeuvres[int(random.integers(1, len(kind.manoeuvres)))],
    )
    flown = usual, other if other_weather else usual
    seeds = random.integers(2**31, size=2 + FURTHER_FLIGHTS).tolist()

    def fly(circumstances: Circumstances, loop: AltitudeLoop, seed: int) -> StepFlight:
        return kind.fly(circumstances.copter, loop, circumstances.manoeuvre, seed)

    def read(circumstances: Circumstances, loop: AltitudeLoop, seed: int) -> LoggedFlight:
        content = kind.write(fly(circumstances, loop, seed).log)
        reader = reader_of(content[:HEAD_BYTES])
        assert reader is not None
        flight = reader.flown(reader.read(BytesIO(content), None), "The log")
        assert isinstance(flight, LoggedFlight)
        return flight

    before = rig.first_loop(copter)
    after = before
    try:
        first = read(flown[0], before, seeds[0])
        after = before.with_gains(_changed(change, first, random))
        logs = [(flown[0], before, first), (flown[1], after, read(flown[1], after, seeds[1]))]
    except TrajectoryError:
        logs = []
    sets = [before, after]
    if random.integers(2):
        logs, sets = logs[::-1], sets[::-1]
    try:
        known = [_logged(flight) for _, _, flight in logs]
    except TrajectoryError:
        known = []
    begin_s = time.process_time()
    found = compare_logs(*known) if known else None
    took_s = time.process_time() - begin_s
    errors = np.array(
        [[[fly(each, loop, seed).error_m for seed in seeds[2:]] for loop in sets] for each in flown]
    )  # circumstances, sets, flights
    scatter = float(np.sqrt(np.mean(np.var(errors, axis=2, ddof=1))))
    difference = float(np.mean(errors[:, 1] - errors[:, 0]))
    comparison = None if found is None else found.comparison
    return Judged(
        autopilot=autopilot,
        change=change,
        other_weather=other_weather,
        truth=difference / scatter,
        told="no model" if found is None else found.verdict or "unresolved",
        estimate=comparison.difference / scatter if comparison else 0.0,
        measured=_measured(found),
        is_contradicted=found is not None and found.is_contradicted,
        took_s=took_s,
        together=_together([flight for _, _, flight in logs], copter) if known else {},
    )


def _together(flights: Sequence[LoggedFlight], copter: SimulatedCopter) -> dict[str, Together]:
    found, rows = combine([log_fit(fit_copter(each), each.loop) for each in flights]), fit_copter(*flights)
    segment, step_s = flights[0].segments[0], flights[0].loop.step_s
    truth = truth_of(copter, lasts_s=segment.duration_s, climb_rate_m_s=segment.v_m_s, step_s=min(step_s, 0.004))
    return {
        name: Together(
            is_inside=abs(mean - truth[name]) <= 1.645 * found.deviation[name],
            remaining=found.remaining[name],
            of_rows=found.deviation[name] / getattr(rows.deviation, name),
            apart=abs(mean - getattr(rows.mean, name)) / getattr(rows.deviation, name),
        )
        for name, mean in found.mean.items()
    }


def _changed(change: str, flight: LoggedFlight, random: np.random.Generator) -> dict[str, float]:
    """The gains of the other flight, within the documented ranges."""
    gains, bounds = flight.loop.gains, flight.loop.space.bounds
    if change == "proposed" and (proposed := analyze(flight).proposed) is not None:
        return dict(proposed.gains)
    factors = dict.fromkeys(gains, 1.0)
    if change == "hardly":
        factors = {name: _log_uniform(random, _HARDLY) for name in gains}
    elif change == "one gain":
        factors[(*gains,)[random.integers(len(gains))]] = _log_uniform(random, _FACTORS)
    elif change != "same":
        factors = {name: _log_uniform(random, _FACTORS) for name in gains}
    return {name: float(np.clip(value * factors[name], *bounds[name])) for name, value in gains.items()}


def _measured(found: GainChange | None) -> str:
    comparison = None if found is None else found.comparison
    if found is None or found.measured_m is None or comparison is None or comparison.standard_error is None:
        return "unresolved"
    certain = NINE_OF_TEN / 2.0**0.5 * comparison.standard_error
    return "unresolved" if abs(found.measured_m) < certain else "better" if found.measured_m < 0.0 else "worse"


def _logged(flight: LoggedFlight) -> FlownLog:
    """What the library has of a log. Raises TrajectoryError if no copter of the model flies so."""
    estimate = fit_copter(flight)
    if find_unexplained(estimate) is not None:
        raise TrajectoryError("No copter flies so.", hint="")
    stored = unpack_flight(pack_flight(flight, estimate.draws))
    return FlownLog(error_m=flight.error_m, flight=stored.flight, copters=stored.copters)


def _log_uniform(random: np.random.Generator, ends: tuple[float, float]) -> float:
    return float(np.exp(random.uniform(*np.log(ends))))


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.log_pairs")
    parser.add_argument("--pairs", type=int, default=QUICK_PAIRS)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--list", action="store_true", help="print every pair")
    chosen = parser.parse_args()
    with ProcessPoolExecutor(chosen.processes) as pool:
        judged = list(pool.map(partial(judge, seed=chosen.seed), range(chosen.pairs)))
    if chosen.list:
        for number, each in enumerate(judged):
            print(number, each)
    return report(judged)


def report(judged: Sequence[Judged]) -> int:
    """Print the figures; 1 beyond the limits."""
    told = ("better", "worse", "unresolved", "no model")
    print(f"{'truth':12}{'pairs':>6}" + "".join(f"{each:>12}" for each in told))
    for class_ in ("better", "worse", "unresolved", "between"):
        counts = Counter(each.told for each in judged if each.class_ == class_)
        print(f"{class_:12}{counts.total():6}" + "".join(f"{counts[each]:12}" for each in told))
    parts: dict[str, list[Judged]] = {
        "all pairs": list(judged),
        "but for those between": [each for each in judged if each.class_ != "between"],
        "in other weather, another manoeuvre": [each for each in judged if each.other_weather],
        **{autopilot: [each for each in judged if each.autopilot == autopilot] for autopilot in KINDS},
        **{change: [each for each in judged if each.change == change] for change in dict.fromkeys(CHANGES)},
    }
    shares = {
        name: (np.mean([each.is_told for each in some]), np.mean([each.is_wrong for each in some]))
        for name, some in parts.items()
        if some
    }
    for name, (right, wrong) in shares.items():
        print(f"{name:38} {len(parts[name]):4}: told {right:.0%}, wrong {wrong:.0%}")
    alone = [replace(each, told=each.measured) for each in judged]
    right, wrong = (np.mean([getattr(each, name) for each in alone]) for name in ("is_told", "is_wrong"))
    print(f"by the measured errors alone: told {right:.0%}, wrong {wrong:.0%}")
    print(f"nothing between: told {np.mean([each.is_told_strictly for each in judged]):.0%}")
    print(f"contradicted by the flights: {sum(each.is_contradicted for each in judged)}")
    print(f"processor time of a comparison: at most {max(each.took_s for each in judged):.2f} s")
    both = [each.together for each in judged if each.together]
    for name in both[0]:
        inside = np.mean([each[name].is_inside for each in both])
        left, of_rows, apart = (
            np.median([getattr(each[name], kind) for each in both]) for kind in ("remaining", "of_rows", "apart")
        )
        print(f"together, {name}: inside {inside:.0%}; left {left:.2f}; of all rows {of_rows:.2f}, apart {apart:.2f}")
    right, wrong = shares["all pairs"]
    return int(right < LIMITS[0] or wrong > LIMITS[1])


if __name__ == "__main__":
    sys.exit(main())
