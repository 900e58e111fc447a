"""States of a server's data for its pages, written straight into its database by the program's own services.

The rows are those that the program itself would write: gains are proposed by the strategy, judged by the gate, and
flown by the simulated vehicle. Every flight is one transaction together with the proposal that follows it, so that the
worker of a running server finds nothing to do; browsers are told of it as of any other change.
"""

import gzip
import io
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from itertools import count
from pathlib import Path
from typing import Any, Final, TypeVar
from uuid import uuid4

from sqlalchemy import delete
from sqlalchemy.orm import Session

from app.accounts.permissions import LOCAL_CLI
from app.autopilots.log_readers import read_takeoff
from app.campaigns import landscapes, proposals
from app.campaigns import service as campaigns
from app.campaigns.computation import compute
from app.campaigns.schemas import NewCampaign
from app.campaigns.trials import photos, records, reviews
from app.campaigns.trials import service as trials
from app.campaigns.trials.schemas import Classification, FlightOrder, NewTrial
from app.common.errors import StorageError
from app.common.settings import Settings
from app.db.base import Base
from app.db.models import EventRow, ProposalRow
from app.db.session import Database
from app.fleet import registration
from app.fleet.schemas import NewVehicle
from app.flights import flight_rows
from app.flights import service as flights
from app.jobs import service as jobs
from app.log_library import service as log_library
from app.log_library import stored_logs
from app.log_library.service import EXAMPLE
from app.reproductions import service as reproductions
from app.reproductions.registry import REPRODUCTIONS
from app.vehicles.base import FlightOptions
from app.vehicles.flight_end import StopRequest
from app.vehicles.registry import open_vehicle, restore_safe_gains
from tests.builders import WORKER

T = TypeVar("T")
Json = dict[str, Any]
LEASE_S: Final = 60.0
_ASKED_IN_2_S: Final = 100
TRIES: Final = 5
"""A writer waits five seconds for another one; what computes on a busy machine may take longer."""


class States:
    """The contents of a server's database, written while it runs or before it does."""

    def __init__(self, data_dir: Path) -> None:
        self._database = Database(Settings(data_dir=data_dir).database_file)

    def close(self) -> None:
        self._database.close()

    # ---- campaigns and flights

    def campaign(
        self,
        vehicle: str = "twin",
        *,
        name: str = "",
        flights: int = 0,
        options: Mapping[str, float] | None = None,
        vehicle_id: int | None = None,
        **definition: object,
    ) -> int:
        """A campaign, under the paper's stop rule unless another is named, with so many flights of its proposals, and
        the next one ready unless it has ended."""
        new = NewCampaign.model_validate(
            {
                "name": name or f"On {vehicle}",
                "vehicle": {"kind": vehicle, "options": dict(options or {}), "id": vehicle_id},
                "definition": {"strategy": "gradient", "stop": {"kind": "paper"}, **definition},
            }
        )

        def create(session: Session) -> int:
            made = campaigns.create_campaign(session, new).id
            _propose(session, made)
            return made

        campaign_id = self._write(create)
        self.fly(campaign_id, flights)
        return campaign_id

    def delete_campaign(self, campaign_id: int) -> None:
        """Delete a campaign without flights."""

        def delete_it(session: Session) -> None:
            version = campaigns.get_campaign(session, campaign_id).version
            campaigns.delete_campaign(session, campaign_id, version, LOCAL_CLI)

        self._write(delete_it)

    def fly(self, campaign_id: int, flights: int = 1) -> list[int]:
        """Fly the next proposals; the trials' ids."""
        return [self._fly(campaign_id, None) for _ in range(flights)]

    def fly_gains(self, campaign_id: int, gains: Mapping[str, float], *, overrule: str | None = None) -> int:
        """Fly gains of one's own, also those that the gate refuses if there is a reason to; the trial's id."""
        return self._fly(campaign_id, {"gains": dict(gains), "overrule": overrule})

    def abort(self, campaign_id: int) -> int:
        """The next proposal, whose flight its operator breaks off in the air; the trial's id."""
        return self._fly(campaign_id, None, stop=StopRequest())

    def repeat(self, campaign_id: int) -> int:
        """Fly the best gains again; the trial's id."""
        return self._fly(campaign_id, {"variant": "repeat"})

    def plan(self, campaign_id: int, gains: Mapping[str, float]) -> int:
        """Make a trial that has not been flown and return its id."""
        return self._write(lambda session: trials.create_trial(session, campaign_id, NewTrial(gains=dict(gains))).id)

    def take_record(self, campaign_id: int, csv: Callable[[Mapping[str, float]], bytes]) -> int:
        """The proposed gains, flown elsewhere: `csv` makes the record that these gains leave; the trial's id."""

        def upload(session: Session) -> int:
            proposal = _proposed(session, campaign_id)
            trial = trials.create_trial(session, campaign_id, NewTrial(proposal_id=proposal.id))
            flown = read_takeoff(io.BytesIO(csv(proposal.gains)), name="flight.csv")
            records.import_record(session, trial.id, flown)
            _propose(session, campaign_id)
            return trial.id

        return self._write(upload)

    def classify(self, trial_id: int, outcome: str, reason: str) -> None:
        """A person's review of a flight, and the gains that follow from it."""

        def say(session: Session) -> None:
            trial = trials.get_trial(session, trial_id)
            said = Classification.model_validate({"version": trial.version, "outcome": outcome, "reason": reason})
            reviews.classify_trial(session, trial_id, said)
            _propose(session, trial.campaign_id)

        self._write(say)

    def photograph(self, trial_id: int, picture: bytes) -> None:
        self._write(lambda session: photos.add_photo(session, trial_id, picture))

    def rehearse(self, campaign_id: int) -> None:
        """Fly the campaign on its simulation until its rehearsal has passed."""
        rehearsal = self._write(lambda session: _rehearsal(session, campaign_id))
        while self._rehearsed(campaign_id) == "under way":
            self.fly(rehearsal)
        assert self._rehearsed(campaign_id) == "passed"

    def survey(self, campaign_id: int) -> None:
        """Compute the error landscape of the latest proposal."""
        with self._database.read() as session:
            order: Json = {"name": f"campaign {campaign_id}", "proposal_id": _proposed(session, campaign_id).id}
            past, proposal = landscapes.read_proposed(session, campaign_id, order)
        survey = landscapes.plan(past, proposal.gains, proposal.explanation.get("base_flight"))
        assert survey is not None, "there is nothing to draw"
        found = survey.landscape(survey.predict_errors(survey.points()))

        def store(session: Session) -> None:
            landscapes.request_landscape(session, campaign_id)
            _finish(session, landscapes.LANDSCAPE_JOB, campaign_id, landscapes.as_json(found, order))

        self._write(store)

    # ---- the rest

    def vehicle(self, name: str, **fields: object) -> int:
        """A registered vehicle that has never been connected."""
        new = NewVehicle.model_validate({"name": name, "kind": "mavlink", **fields})
        return self._write(lambda session: registration.register_vehicle(session, new, LOCAL_CLI).id)

    def vehicle_of(self, campaign_id: int) -> int:
        with self._database.read() as session:
            return campaigns.get_row(session, campaign_id).vehicle_id

    def reproduce(self, name: str) -> None:
        """A reproduction that was run."""
        result = asdict(REPRODUCTIONS[name].run(lambda _share, _doing: None, False))

        def store(session: Session) -> None:
            reproductions.request_run(session, name, full=False)
            _finish(session, reproductions.REPRODUCTION_JOB, None, result)

        self._write(store)

    def propose_again(self, campaign_id: int, times: int) -> None:
        """As many jobs that are done."""

        def ask(session: Session) -> None:
            campaigns.compute_proposal(session, campaign_id)
            _propose(session, campaign_id)

        for _ in range(times):
            self._write(ask)

    def clear(self) -> None:
        """Take everything out, as if the server had been started with a new folder. What is told to browsers stays, in
        order that those connected learn of what comes; ids are never used twice."""

        def empty(session: Session) -> None:
            for table in reversed(Base.metadata.sorted_tables):
                if table.name != EventRow.__tablename__:
                    session.execute(delete(table))

        self._write(empty)

    # ---- logs

    def store_logs(self, *, hardware_id: str = "", logs: int = 1) -> list[int]:
        """The example log, analysed once and stored so many times; the logs' ids."""
        found = log_library.analyze_limited(gzip.decompress(EXAMPLE.read_bytes()), None, name=EXAMPLE.stem)
        found = replace(found, hardware_id=hardware_id)
        return [self._write(lambda s: stored_logs.store(s, found, uuid4().hex, "")) for _ in range(logs)]

    def keep_log(self, log_id: int, vehicle: str) -> int:
        """Keep a log as a flight of that vehicle; the vehicle's id."""
        kept = self._write(lambda session: stored_logs.keep(session, log_id, vehicle)).vehicle
        assert kept is not None
        return kept.id

    def rename_logged_vehicle(self, vehicle_id: int, name: str) -> None:
        self._write(lambda session: stored_logs.rename_vehicle(session, vehicle_id, name))

    # ---- one transaction each

    def _write(self, work: Callable[[Session], T]) -> T:
        for _ in range(TRIES):
            with suppress(StorageError), self._database.write() as session:
                return work(session)
        raise AssertionError("the database was busy for too long")

    def _fly(self, campaign_id: int, chosen: Json | None, *, stop: StopRequest | None = None) -> int:
        def fly(session: Session) -> int:
            what = {"proposal_id": _proposed(session, campaign_id).id} if chosen is None else chosen
            trial = trials.create_trial(session, campaign_id, NewTrial.model_validate(what))
            flights.fly_new_trial(session, trial.id, FlightOrder(speed=None))
            _carry_out(session, trial.id, stop)
            _propose(session, campaign_id)
            return trial.id

        return self._write(fly)

    def _rehearsed(self, campaign_id: int) -> str:
        with self._database.read() as session:
            return campaigns.get_campaign(session, campaign_id).rehearsal.state


def _rehearsal(session: Session, campaign_id: int) -> int:
    made = campaigns.rehearse(session, campaign_id).id
    _propose(session, made)
    return made


def _proposed(session: Session, campaign_id: int) -> ProposalRow:
    """The proposal that holds now."""
    return proposals.require_fresh_proposal(session, campaigns.get_row(session, campaign_id))


def _carry_out(session: Session, trial_id: int, stop: StopRequest | None) -> None:
    """What a worker does with the flight that was asked for, which `stop` ends after two seconds."""
    task = flight_rows.claim_flight(session, WORKER)
    assert task is not None
    assert task.trial_id == trial_id, "another flight waits"
    with open_vehicle(task.vehicle_kind, task.vehicle_options, safe_gains=task.safe_gains) as vehicle:
        flight_rows.record_staged(session, task.flight_id, vehicle.stage(task.gains))
        flight_rows.record_lift_off(session, task.flight_id)
        order = FlightOptions(seed=task.seed)
        seen = count()
        record = vehicle.fly(
            order, on_sample=lambda _sample: None, should_stop=lambda: stop if next(seen) > _ASKED_IN_2_S else None
        )
        restored = restore_safe_gains(vehicle)
    flight_rows.record_outcome(session, task.flight_id, flight_rows.FlightOutcome(record=record, restored=restored))


def _propose(session: Session, campaign_id: int) -> None:
    """Carry out the campaign's waiting proposal job, if there is one, as a worker does."""
    waiting = jobs.latest_job(session, campaign_id, proposals.PROPOSAL_JOB)
    if waiting is None or waiting.state != "queued":
        return
    computed = compute(proposals.read_history(session, campaign_id))
    _finish(session, proposals.PROPOSAL_JOB, campaign_id)
    proposals.store_proposal(session, campaign_id, computed)


def _finish(session: Session, kind: str, campaign_id: int | None, result: Json | None = None) -> None:
    """The waiting job of that kind is done; others that wait are left to the server's own worker."""
    others = []
    while (job := jobs.claim_job(session, worker=WORKER, kinds=(kind,), lease_s=LEASE_S)) is not None:
        if job.campaign_id == campaign_id:
            jobs.finish_job(session, job.id, worker=WORKER, result=result)
            break
        others.append(job.id)
    assert job is not None, f"no {kind} job of campaign {campaign_id} waits"
    for other in others:
        jobs.requeue_job(session, other, worker=WORKER)
