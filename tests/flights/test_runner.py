"""Carrying out flights: a real flight runner on a real database, with real vehicles in processes of their own."""

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator
from datetime import timedelta

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text
from sqlalchemy.orm import Session

from app.common.settings import Settings
from app.common.states import FlightState, TrialState
from app.db.models import FlightRow, VehicleRow
from app.db.session import Database
from app.fleet.service import hold_gains
from app.flights.flight_process import FlightProcess, FlightProcessPool
from app.flights.flight_rows import REQUEST_TIMEOUT
from app.flights.process_messages import (
    FlightFailure,
    FlightMessage,
    FlightRequest,
    GainsStaged,
    SafeGainsRestored,
)
from app.flights.runner import FlightRunner
from app.flights.worker_part import AbortRegistry, WorkerPart
from app.live.messages import FlightPhase, PublishedMessage
from app.vehicles.flight_end import StopRequest, end_text, withdrawn_by
from tests.builders import create_ready_campaign, create_record, create_trial, get, stage
from tests.campaigns.trials.states import make_vehicle_real
from tests.clocks import SimulatedClock
from tests.conftest import Listen
from tests.flights.process_ids import pid_of

Watch = Callable[[PublishedMessage], None]


class RunnerFixture:
    """A flight runner with its abort registry; `watch` hears what the flights say."""

    def __init__(self, database: Database, settings: Settings) -> None:
        self.abort_registry = AbortRegistry()
        self.heard: list[PublishedMessage] = []
        self.watch: Watch = lambda _said: None
        part = WorkerPart(
            database=database,
            data_dir=settings.data_dir,
            abort_registry=self.abort_registry,
            publish=self._hear,
            worker="tests",
            closing=threading.Event(),
            clock=SimulatedClock(),
        )
        self.pool = FlightProcessPool(part.data_dir, part.clock)
        self.runner = FlightRunner(part, session=self._session, pool=self.pool)

    def fly_next(self) -> None:
        task = self.runner.claim()
        assert task is not None
        self.runner.carry_out(task)

    def kill_processes(self) -> None:
        for process in self.pool._waiting:
            os.kill(pid_of(process), signal.SIGKILL)

    def _session(self, vehicle_id: int) -> FlightProcess:
        raise AssertionError(f"Vehicle {vehicle_id} is flown without a link.")

    def _hear(self, said: PublishedMessage) -> None:
        self.heard.append(said)
        self.watch(said)


@pytest.fixture
def field(client: TestClient, database: Database, settings: Settings) -> Iterator[RunnerFixture]:
    one = RunnerFixture(database, settings)
    yield one
    one.runner.close()


@pytest.fixture
def trial_id(client: TestClient, database: Database, field: RunnerFixture) -> int:
    """A trial whose flight on the twin is asked for."""
    campaign = create_ready_campaign(client, database)
    identity: int = create_trial(client, campaign["id"], fly={"speed": None})["id"]
    return identity


def vehicle_state(client: TestClient) -> str:
    state: str = get(client, "/api/vehicles/1")["state"]
    return state


WhenChanged = Callable[..., None]


@pytest.fixture
def when_changed_to(database: Database, listen: Listen) -> WhenChanged:
    def arrange(state: TrialState | FlightState, act: Callable[[], object], *, stored: bool = True) -> None:
        _arrange(database, listen, state, act, stored=stored)

    return arrange


def _arrange(
    database: Database, listen: Listen, state: TrialState | FlightState, act: Callable[[], object], *, stored: bool
) -> None:
    """Something that happens once: as soon as others can see this state, or before it is `stored`."""
    still_to_happen = [act]
    changed: list[bool] = []

    def look(session: Session, _context: object) -> None:
        if any(getattr(row, "state", None) is state for row in session.dirty):
            changed.append(True)
            if not stored:
                happen(session)

    def happen(_session: Session) -> None:
        if changed and still_to_happen:
            still_to_happen.pop()()

    listen(database._writers, "after_flush", look)
    listen(database._writers, "after_commit", happen)


def refuse(database: Database, operation: str) -> None:
    """The database takes no such statement any more, for a reason that is no trouble of the storage."""
    with database.write() as session:
        session.execute(
            text(f"CREATE TRIGGER refusal BEFORE {operation} BEGIN SELECT RAISE(ABORT, 'not this one'); END")
        )


def test_a_flight_goes_from_its_request_to_its_outcome(client: TestClient, field: RunnerFixture, trial_id: int) -> None:
    field.fly_next()
    flown = get(client, f"/api/trials/{trial_id}")
    assert (flown["state"], flown["flight"]["state"]) == ("valid", "landed")
    assert [said.phase for said in field.heard if isinstance(said, FlightPhase)] == [
        "staging", "flying", "landed", "ended"]  # fmt: skip
    assert field.abort_registry.trial_ids() == []
    assert vehicle_state(client) == "ready"


@pytest.mark.complete
def test_an_abort_while_the_lift_off_is_stored_is_no_flight(
    client: TestClient, when_changed_to: WhenChanged, field: RunnerFixture, settings: Settings, trial_id: int
) -> None:
    """Observed defect: it was an aborted flight, landed, whose cause had to be given."""
    when_changed_to(TrialState.FLYING, lambda: field.abort_registry.abort(trial_id, StopRequest("somebody walked in")))
    field.fly_next()
    ended = get(client, f"/api/trials/{trial_id}")
    assert (ended["state"], ended["flown_at"], ended["record"]) == ("planned", None, None)
    assert ended["reason"] == ended["flight"]["problem"] == end_text(withdrawn_by(StopRequest("somebody walked in")))
    assert (ended["flight"]["state"], ended["abort_cause"]) == ("cancelled", None)
    assert [said.phase for said in field.heard if isinstance(said, FlightPhase)] == ["staging", "flying", "ended"]
    assert list((settings.data_dir / "spool").iterdir()) == []
    assert vehicle_state(client) == "ready"
    assert client.post(f"/api/trials/{trial_id}/fly", json={}).is_success
    field.fly_next()
    assert get(client, f"/api/trials/{trial_id}")["state"] == "valid"


def test_a_flight_can_be_aborted_from_the_moment_at_which_it_is_seen_to_run(
    client: TestClient, when_changed_to: WhenChanged, field: RunnerFixture, trial_id: int
) -> None:
    seen: list[bool] = []

    when_changed_to(
        FlightState.RUNNING, lambda: seen.append(field.abort_registry.abort(trial_id, StopRequest("changed my mind")))
    )
    field.fly_next()
    assert seen == [True]
    ended = get(client, f"/api/trials/{trial_id}")
    assert (ended["state"], ended["flight"]["state"]) == ("planned", "cancelled")
    assert (ended["flight"]["end"]["failure"], ended["flight"]["end"]["request"]["words"]) == ("F8", "changed my mind")
    assert ended["read_back"] is None, "nothing was sent to the vehicle"


def test_a_claim_that_is_not_stored_leaves_the_abort_registry_free(
    client: TestClient, when_changed_to: WhenChanged, field: RunnerFixture, trial_id: int
) -> None:
    def fail() -> None:
        raise RuntimeError("the power went")

    when_changed_to(FlightState.RUNNING, fail, stored=False)
    with pytest.raises(RuntimeError, match="the power went"):
        field.runner.claim()
    assert field.abort_registry.trial_ids() == []


def test_a_flight_that_was_asked_for_while_the_worker_was_away_does_not_take_off(
    client: TestClient, field: RunnerFixture, trial_id: int
) -> None:
    field.runner.recover()
    assert field.runner.claim() is None
    after = get(client, f"/api/trials/{trial_id}")
    assert (after["state"], after["flight"]["state"]) == ("planned", "cancelled")
    assert "no worker was running when it was requested" in after["flight"]["problem"]
    assert client.post(f"/api/trials/{trial_id}/fly").status_code in {202, 503}, "it can be asked for again"


def test_a_flight_that_waited_too_long_is_withdrawn_and_one_of_now_is_flown(
    client: TestClient, database: Database, field: RunnerFixture, trial_id: int
) -> None:
    with database.write() as session:
        for row in session.query(FlightRow):
            row.requested_at -= REQUEST_TIMEOUT + timedelta(seconds=1)
    assert field.runner.claim() is None
    flight = get(client, f"/api/trials/{trial_id}")["flight"]
    assert flight["state"] == "cancelled"
    assert "could not be started within 10 s" in flight["problem"]


def test_an_outcome_that_the_database_refuses_costs_the_flight_but_blocks_nothing(
    client: TestClient, database: Database, field: RunnerFixture, settings: Settings, trial_id: int
) -> None:
    refuse(database, "INSERT ON trajectory")
    field.fly_next()
    lost = get(client, f"/api/trials/{trial_id}")
    assert (lost["state"], lost["flight"]["state"]) == ("lost", "lost")
    (kept,) = (settings.data_dir / "spool").iterdir()
    assert f"saved as {kept}" in lost["reason"]
    assert kept.suffix == ".unusable"
    assert vehicle_state(client) == "ready"
    assert field.abort_registry.trial_ids() == []


def test_a_refused_outcome_whose_record_was_not_spooled_either_is_said_so(
    client: TestClient, database: Database, field: RunnerFixture, settings: Settings, trial_id: int
) -> None:
    refuse(database, "INSERT ON trajectory")
    spool = settings.data_dir / "spool"

    def lose_the_spool(said: PublishedMessage) -> None:
        if isinstance(said, FlightPhase) and said.phase == "landed" and spool.exists():
            for path in spool.iterdir():
                path.unlink()
            spool.rmdir()

    field.watch = lose_the_spool
    field.fly_next()
    lost = get(client, f"/api/trials/{trial_id}")
    assert lost["state"] == "lost"
    assert "could not be saved either" in lost["reason"]
    assert vehicle_state(client) == "ready"


@pytest.mark.parametrize(("real", "then"), [(True, "quarantined"), (False, "ready")])
def test_a_process_that_dies_with_the_vehicle_leaves_a_real_one_in_quarantine(
    client: TestClient, database: Database, field: RunnerFixture, trial_id: int, real: bool, then: str
) -> None:
    if real:
        make_vehicle_real(database)
    field.kill_processes()
    field.fly_next()
    after = get(client, f"/api/trials/{trial_id}")
    assert (after["state"], after["flight"]["state"]) == ("planned", "failed")
    assert "exit code -9" in after["flight"]["problem"]
    vehicle = get(client, "/api/vehicles/1")
    assert vehicle["state"] == then
    assert ("before the safe gains were read back" in vehicle["concern"]) == real


def test_a_quarantine_over_gains_that_were_not_read_back_stays_true_when_they_are_read_again(
    client: TestClient, database: Database, field: RunnerFixture, trial_id: int
) -> None:
    make_vehicle_real(database)
    with database.write() as session:
        hold_gains(session.get_one(VehicleRow, 1), {"kp": 283.0})
    field.kill_processes()
    field.fly_next()
    assert get(client, "/api/vehicles/1")["held"] is None
    with database.write() as session:
        hold_gains(session.get_one(VehicleRow, 1), {"kp": 283.0})
    vehicle = get(client, "/api/vehicles/1")
    assert vehicle["held"] == {"kp": 283.0}
    assert vehicle["concern"] == "Its process ended before the safe gains were read back after the flight."


@pytest.mark.parametrize(("real", "then"), [(True, "quarantined"), (False, "ready")])
def test_a_worker_that_died_with_gains_staged_leaves_a_real_vehicle_in_quarantine(
    client: TestClient, database: Database, field: RunnerFixture, trial_id: int, real: bool, then: str
) -> None:
    if real:
        make_vehicle_real(database)
    stage(database)
    field.runner.recover()
    assert get(client, f"/api/trials/{trial_id}")["state"] == "planned"
    assert vehicle_state(client) == then


def test_a_real_vehicle_is_not_in_doubt_when_nothing_was_sent_to_it(
    client: TestClient, database: Database, field: RunnerFixture, settings: Settings, trial_id: int
) -> None:
    make_vehicle_real(database)
    (settings.data_dir / "spool").write_text("a file in the way")
    field.fly_next()
    assert "no space for the flight record" in get(client, f"/api/trials/{trial_id}")["flight"]["problem"]
    assert vehicle_state(client) == "ready"


class Refusing:
    """Whoever has a vehicle that takes its gains and then will not arm."""

    alive = True
    takes_its_safe_gains = True

    def fly(self, request: FlightRequest) -> Generator[FlightMessage]:
        yield GainsStaged(dict(request.gains))
        if self.takes_its_safe_gains:
            yield SafeGainsRestored(dict(request.safe_gains))
        yield FlightFailure("The vehicle did not arm.", unsafe=not self.takes_its_safe_gains, not_flown=True)

    def decide(self, takes_off: bool) -> None: ...
    def cancel_flight(self, trial_id: int, request: StopRequest) -> None: ...
    def close(self) -> None: ...


def test_a_flight_that_never_left_the_ground_is_refused_and_can_be_flown_again(
    client: TestClient, field: RunnerFixture, trial_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(field.pool, "acquire", Refusing)
        field.fly_next()
    after = get(client, f"/api/trials/{trial_id}")
    assert (after["state"], after["flight"]["state"], after["flown_at"]) == ("planned", "failed", None)
    assert after["reason"] == "The vehicle did not arm."
    assert get(client, f"/api/campaigns/{after['campaign_id']}")["state"] == "deciding"
    assert vehicle_state(client) == "ready"
    assert client.post(f"/api/trials/{trial_id}/fly", json={}).is_success
    field.fly_next()
    assert get(client, f"/api/trials/{trial_id}")["state"] == "valid"


class RefusingAll(Refusing):
    """And that does not take its safe gains any more either."""

    takes_its_safe_gains = False


@pytest.mark.parametrize(("backend", "then"), [(Refusing, "ready"), (RefusingAll, "quarantined")])
def test_a_real_vehicle_that_never_left_the_ground_is_in_doubt_only_for_its_gains(
    client: TestClient,
    database: Database,
    field: RunnerFixture,
    trial_id: int,
    monkeypatch: pytest.MonkeyPatch,
    backend: type[Refusing],
    then: str,
) -> None:
    make_vehicle_real(database)
    monkeypatch.setattr(field.pool, "acquire", backend)
    field.fly_next()
    after = get(client, f"/api/trials/{trial_id}")
    assert (after["state"], after["flight"]["state"], after["flown_at"]) == ("planned", "failed", None)
    assert vehicle_state(client) == then


def test_the_record_of_a_lost_flight_is_recovered_from_the_spool(
    client: TestClient, database: Database, field: RunnerFixture, trial_id: int
) -> None:
    task = field.runner.claim()
    assert task is not None
    with database.write() as session:
        session.query(FlightRow).one().trial.state = TrialState.FLYING
    field.runner._spool.reserve(task.flight_id)
    field.runner._spool.write(task.flight_id, create_record(1.0))
    field.runner.recover()
    assert get(client, f"/api/trials/{trial_id}")["state"] == "valid"
    assert field.runner._spool.flight_ids() == []


def test_a_vehicle_that_is_staged_and_not_flown_within_ten_minutes_has_its_safe_gains_back(
    client: TestClient, database: Database, field: RunnerFixture, trial_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.flights.runner.POLL_INTERVAL_S", 5.0)
    with database.write() as session:
        row = session.query(FlightRow).one()
        row.mode, row.take_off_at = "stage", None
    field.fly_next()
    after = get(client, f"/api/trials/{trial_id}")
    assert (after["state"], after["flight"]["state"]) == ("planned", "cancelled")
    assert after["flight"]["problem"] == "its takeoff was not requested within 10 minutes"
    assert vehicle_state(client) == "ready"
