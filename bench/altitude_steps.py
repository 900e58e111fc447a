"""What tuning altitude steps by the strategy `calibrated` is worth on the simulated vehicles.

    ./dev exec python -m bench.altitude_steps [--vehicles 4] [--linked 8]

Flies the default gains and the proposal that follows, on the JSBSim quadrotor and on random twins, each twin with the
scatter of real flights and without. Prints the errors of both flights, the predicted error of the second, what its
gains score without scatter, and the least error that a search finds on the vehicle itself. Flights that had not settled
before the first step are not scored; their vehicles are counted. Then the same on vehicles with physics and noise
beyond the model, recorded as over a link (bench/copters/paparazzi_simulation.py), with four flights of each proposal in
other weather. Exits with 1 if a second flight is not below the first, or the second flights over a link miss limits,
which are loose because the vehicles are few.
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.autopilots.registry import evidence_of
from app.core.analysis.margin import RINGING_DAMPING
from app.core.analysis.proposal import LARGEST_ACTIVITY
from app.core.definition import Definition, Flight
from app.core.errors import TrajectoryError
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.experiments.base import halton
from app.core.policy import Box, Gains, Vector
from app.core.records.trajectory import Trajectory
from app.core.tuning.campaign_models import minimise_in_box
from app.core.tuning.proposals import next_proposal
from app.vehicles.base import RECORDED_BEYOND_S
from app.vehicles.jsbsim import JsbsimFlight
from app.vehicles.registry import check_options
from app.vehicles.simulated import simulate_flight, trajectory_of
from app.vehicles.twin import TwinFlight
from bench.copters import paparazzi_simulation
from bench.targets.vehicles import SampledVehicle, population

SEED: Final = 20261127
STEPS: Final = AltitudeSteps()
SPACE: Final = STEPS.space
DEFINITION: Final = Definition(experiment=STEPS.name, strategy="calibrated")
RECORD_STEPS: Final = round((STEPS.window_s + RECORDED_BEYOND_S) * 512) + 1
LINKED_FLIGHTS: Final = 4
LEAST_INSIDE: Final = 0.7
POINTS: Final[Mapping[str, int]] = {"twin": 128, "jsbsim": 40}
EVALUATIONS: Final[Mapping[str, int]] = {"twin": 150, "jsbsim": 60}
"""Of a search on the vehicle: points spread over the bounds, then Nelder–Mead from the best of them."""


@dataclass(frozen=True, slots=True)
class Tuned:
    """Errors in m; `first` and `second` are None where the flight could not be scored."""

    first: float | None
    second: float | None
    predicted: float | None
    inside: bool
    gains: Gains
    calm: float
    searched: float
    searched_gains: Gains


def fly(vehicle: SampledVehicle, gains: Gains, seed: int) -> Trajectory:
    options = {name: float(value) for name, value in vehicle.options.items()}
    simulation = (JsbsimFlight if vehicle.kind == "jsbsim" else TwinFlight)(options, seed)
    return trajectory_of(simulate_flight(simulation, gains, STEPS.set_points, RECORD_STEPS), vehicle.kind).as_stored()


def error_of(vehicle: SampledVehicle, gains: Gains, seed: int = 0) -> float | None:
    try:
        return STEPS.error(fly(vehicle, gains, seed))
    except TrajectoryError:
        return None


def tune(vehicle: SampledVehicle) -> Tuned:
    flights: list[Flight] = []
    errors: list[float | None] = []
    proposal = next_proposal(evidence_of(DEFINITION, flights))
    for number in (1, 2):
        if number == 2:
            proposal = next_proposal(evidence_of(DEFINITION, flights))
        record = fly(vehicle, proposal.gains, SEED + 100 * vehicle.number + number)
        try:
            error = STEPS.error(record)
        except TrajectoryError:
            errors.append(None)
            break
        errors.append(error)
        flights.append(
            Flight(number=number, gains=dict(proposal.gains), trajectory=record, error=error, outcome="valid")
        )
    first, second = (*errors, None, None)[:2]
    quiet = vehicle.quiet
    calm = error_of(quiet, proposal.gains)
    searched, searched_gains = search(quiet, proposal.gains)
    return Tuned(
        first=first,
        second=second,
        predicted=proposal.predicted_error if second is not None else None,
        inside=second is not None and proposal.interval is not None and second in proposal.interval,
        gains=proposal.gains,
        calm=np.inf if calm is None else calm,
        searched=searched,
        searched_gains=searched_gains,
    )


def search(vehicle: SampledVehicle, known: Gains) -> tuple[float, Gains]:
    """The least error without scatter, from points spread over the bounds and `known`, then by Nelder–Mead."""

    def error(gains: Vector) -> float:
        found = error_of(vehicle, SPACE.mapping(SPACE.nearest(gains)))
        return 10.0 if found is None else found

    spread = SPACE.lower + halton(3, POINTS[vehicle.kind] + 1)[1:] * (SPACE.upper - SPACE.lower)
    points = np.vstack((SPACE.vector(known), spread))
    start = points[int(np.argmin([error(point) for point in points]))]
    steps = (SPACE.upper - SPACE.lower) / 10.0
    end = minimise_in_box(
        error, start, steps, Box(SPACE.lower, SPACE.upper), evaluations=EVALUATIONS[vehicle.kind], tolerance=1.0
    )
    best = min((start, end), key=error)
    return error(best), SPACE.mapping(SPACE.nearest(best))


def vehicles(count: int) -> dict[str, list[SampledVehicle]]:
    jsbsim = SampledVehicle(population="", number=1, kind="jsbsim", options=check_options("jsbsim", {}))
    windy = replace(jsbsim, options=check_options("jsbsim", {"gust_m_s": 1.0, "altitude_noise_m": 0.01}))
    found = {"JSBSim": [jsbsim], "JSBSim, gusts of 1 m/s": [windy]}
    for name in ("four-parameter", "further-physics"):
        twins = [each for each in population(name, 2 * count, SEED) if each.kind == "twin"][:count]
        found |= {f"{name} twins, no scatter": [each.quiet for each in twins], f"{name} twins": twins}
    return found


@dataclass(frozen=True, slots=True)
class Linked:
    """A campaign over a link: errors, m, of the first flight and of further ones with the proposed gains, whether each
    lies in the interval, error over prediction and throttle activity over the default gains', as means of these
    flights, and damping of the vehicle itself, as it is and within the margin."""

    first: float
    errors: tuple[float, ...]
    inside: tuple[bool, ...]
    ratio: float
    activity: float
    damping: float
    within_margin: float


def tune_over_link(number: int) -> Linked | None:
    """None where the first flight could not be scored."""
    random = np.random.default_rng((SEED, number))
    vehicle = paparazzi_simulation.sample(random)
    first_seed, *seeds = random.integers(2**31, size=1 + LINKED_FLIGHTS).tolist()
    default = SPACE.mapping(SPACE.default)
    record, _ = paparazzi_simulation.fly(STEPS, vehicle, default, first_seed)
    try:
        first = STEPS.error(record)
    except TrajectoryError:
        return None
    flight = Flight(number=1, gains=default, trajectory=record, error=first, outcome="valid")
    proposal = next_proposal(evidence_of(DEFINITION, [flight]))
    flown = [paparazzi_simulation.fly(STEPS, vehicle, proposal.gains, seed) for seed in seeds]
    usual = [paparazzi_simulation.fly(STEPS, vehicle, default, seed)[1] for seed in seeds]
    errors = tuple(STEPS.error(each) for each, _ in flown)
    assert proposal.interval is not None
    assert proposal.predicted_error is not None
    return Linked(
        first=first,
        errors=errors,
        inside=tuple(error in proposal.interval for error in errors),
        ratio=float(np.mean(errors)) / proposal.predicted_error,
        activity=float(np.mean([moved for _, moved in flown]) / np.mean(usual)),
        damping=paparazzi_simulation.least_damping(vehicle, proposal.gains),
        within_margin=paparazzi_simulation.within_margin(vehicle, proposal.gains),
    )


def measure_links(count: int) -> bool:
    """Print what became of the campaigns; whether the limits hold."""
    scored = [each for number in range(count) if (each := tune_over_link(number)) is not None]
    inside = np.mean([within for each in scored for within in each.inside])
    second = np.array([np.mean(each.errors) for each in scored])
    activity = np.array([each.activity for each in scored])
    low, high = np.quantile([each.ratio for each in scored], (0.05, 0.95)).tolist()
    first = float(np.median([each.first for each in scored]))
    rings = sum(each.damping < RINGING_DAMPING for each in scored)
    print(
        f"over a link: {len(scored)} of {count} scored; median flight 1 {mm(first)}, "
        f"flight 2 {mm(float(np.median(second)))}, 95 % below {mm(float(np.quantile(second, 0.95)))}; {inside:.0%} of "
        f"{LINKED_FLIGHTS * len(scored)} flights inside the 90 % interval; flown over predicted: median "
        f"{np.median([each.ratio for each in scored]):.2f}, 5 … 95 % {low:.2f} … {high:.2f}; throttle activity: median "
        f"{np.median(activity):.2f}, largest {activity.max():.2f}, above {LARGEST_ACTIVITY:g} "
        f"{np.sum(activity > LARGEST_ACTIVITY)}; ring {rings}, lack the margin "
        f"{sum(each.within_margin < RINGING_DAMPING for each in scored)}"
    )
    return bool(inside >= LEAST_INSIDE and rings == 0 and all(np.mean(each.errors) < each.first for each in scored))


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.altitude_steps")
    parser.add_argument("--vehicles", type=int, default=4, help="random twins of each population")
    parser.add_argument("--linked", type=int, default=8, help="random vehicles over a link")
    chosen = parser.parse_args()
    failed = not measure_links(chosen.linked)
    for name, some in vehicles(chosen.vehicles).items():
        tuned = [tune(each) for each in some]
        print(f"{name}: {summary(tuned)}", flush=True)
        for each in tuned:
            gains = "/".join(f"{value:g}" for value in each.gains.values())
            best = "/".join(f"{value:g}" for value in each.searched_gains.values())
            print(
                f"    flight 1 {mm(each.first)}, flight 2 {mm(each.second)} (predicted {mm(each.predicted)}, "
                f"{'inside' if each.inside else 'outside'}) with {gains}, calm {mm(each.calm)}; search "
                f"{mm(each.searched)} with {best}",
                flush=True,
            )
            failed |= each.first is not None and each.second is not None and each.second >= each.first
    return int(failed)


def mm(error_m: float | None) -> str:
    return "not scored" if error_m is None else f"{1e3 * error_m:.1f} mm"


def summary(tuned: list[Tuned]) -> str:
    """Medians over the vehicles, and how the second flights compare with the search and with their predictions."""
    scored = [each for each in tuned if each.first is not None and each.second is not None]
    if not scored:
        return f"none of {len(tuned)} scored"
    first, second, searched = (
        float(np.median([getattr(each, what) for each in scored])) for what in ("first", "second", "searched")
    )
    ratio = np.array([each.calm / each.searched for each in scored])
    return (
        f"{len(scored)} of {len(tuned)} scored; median flight 1 {mm(first)}, flight 2 {mm(second)}, search "
        f"{mm(searched)}; gains of flight 2 without scatter over the search: median {np.median(ratio):.2f}, worst "
        f"{ratio.max():.2f}; {sum(each.inside for each in scored)} inside the predicted interval"
    )


if __name__ == "__main__":
    sys.exit(main())
