"""Time from a campaign's stored history to the stored next proposal, as in the worker.

    ./dev exec python -m bench.proposal

Uses a real database, simulated flights stored as a worker stores them, and the worker's own job runner: it reads and
unpacks the history and sends it to a process of the pool, which computes the proposal; then the gate and the stop rule
are applied and the result is stored. Times every proposal of a campaign of seven flights, for each start and option,
with the pool ready as in a running worker, and once from a cold start. Prints the best of three rounds of each; exits
with 1 if one takes more than a second, or more in proportion on a slower machine.
"""

import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Final

from app.campaigns import service as campaigns
from app.campaigns.computation import warm_up
from app.campaigns.proposals import PROPOSAL_JOB
from app.campaigns.schemas import Definition, NewCampaign, StopRule
from app.campaigns.tasks import compute_proposal
from app.campaigns.trials.schemas import FlightOrder, TrialPlan
from app.campaigns.trials.service import create_trial
from app.db.migrate import migrate
from app.db.session import Database
from app.fleet.schemas import VehicleChoice
from app.flights import flight_rows
from app.flights import service as flights
from app.jobs.runner import JobRunner
from app.processes.calls import ComputePool
from app.vehicles.base import FlightOptions as Order
from app.vehicles.registry import open_vehicle
from bench.timing.machine import measured_slowness

LIMIT_S: Final = 1.0
WORKER: Final = "bench"
FLIGHTS: Final = 7
ROUNDS: Final = 3
CASES: Final[dict[str, dict[str, object]]] = {
    "calibrated": {"strategy": "calibrated"},
    "gradient, scaled": {"strategy": "gradient"},
    "gradient, raw": {"strategy": "gradient", "options": {"scaled": False}},
    "gradient from the simplex start": {"strategy": "gradient", "start": {"kind": "simplex"}},
    "simplex": {"strategy": "simplex"},
}


def propose(runner: JobRunner) -> float:
    """Run the waiting job and return the time from its claim to the stored row, s."""
    start = time.perf_counter()
    job = runner.claim()
    assert job is not None
    runner.carry_out(job)
    return time.perf_counter() - start


def fly(database: Database, campaign_id: int) -> bool:
    """Fly the proposal; return False if the campaign has ended."""
    with database.write() as session:
        following = campaigns.next_flight(session, campaign_id).proposal
        if following is None or "plan" not in campaigns.get_campaign(session, campaign_id).actions:
            return False
        planned = create_trial(session, campaign_id, TrialPlan(proposal_id=following.id))
        flights.fly_new_trial(session, planned.id, FlightOrder(speed=None))
        task = flight_rows.claim_flight(session, WORKER)
    assert task is not None
    with open_vehicle(task.vehicle_kind, task.vehicle_options, safe_gains=task.safe_gains) as vehicle:
        read_back = vehicle.stage(task.gains)
        record = vehicle.fly(Order(seed=task.seed), on_sample=lambda _: None, should_stop=lambda: None)
    with database.write() as session:
        flight_rows.record_staged(session, task.flight_id, read_back)
        flight_rows.record_lift_off(session, task.flight_id)
        flight_rows.record_outcome(session, task.flight_id, flight_rows.FlightOutcome(record=record))
    return True


def one_campaign(database: Database, runner: JobRunner, fields: dict[str, object]) -> list[float]:
    """Return the time of each proposal of a campaign, s."""
    definition = Definition.model_validate({"stop": StopRule(kind="budget", max_flights=FLIGHTS), **fields})
    with database.write() as session:
        created = campaigns.create_campaign(
            session, NewCampaign(name="bench", vehicle=VehicleChoice(kind="jsbsim"), definition=definition)
        )
    times = [propose(runner)]
    while fly(database, created.id):
        times.append(propose(runner))
    return times


def main() -> int:
    with tempfile.TemporaryDirectory() as folder, measured_slowness() as slowness:
        file = Path(folder) / "gainline.sqlite3"
        migrate(file)
        database = Database(file)
        cold = time.perf_counter()
        with ComputePool(1, prepare=warm_up) as pool:
            propose_next = partial(compute_proposal, database, pool, worker=WORKER)
            runner = JobRunner(database, PROPOSAL_JOB, propose_next, room=1, worker=WORKER, lease_s=30.0)
            first = one_campaign(database, runner, {"stop": StopRule(kind="budget", max_flights=1)})
            print(
                f"cold, the start of the process included: {time.perf_counter() - cold:.2f} s ({first[0]:.2f} s first)"
            )
            slowest = 0.0
            for name, fields in CASES.items():
                rounds = [one_campaign(database, runner, fields) for _ in range(ROUNDS)]
                times = [min(each) for each in zip(*rounds, strict=True)]
                slowest = max(slowest, *times)
                print(f"{name:32}", " ".join(f"{each * 1e3:4.0f}" for each in times), "ms")
        database.close()
    slow = slowness()
    print(f"slowest warm proposal: {slowest * 1e3:.0f} ms (limit {LIMIT_S * 1e3:.0f} ms × {slow:.2f})")
    return 0 if slowest <= LIMIT_S * slow else 1


if __name__ == "__main__":
    sys.exit(main())
