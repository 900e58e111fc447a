"""Operations on log files: analyse one of any autopilot, and create a campaign from one."""

import gzip
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath
from typing import Final

from sqlalchemy.orm import Session

from app.accounts.permissions import RequestContext
from app.autopilots.takeoffs import Takeoff
from app.campaigns import service as campaigns
from app.campaigns.history import set_campaign_state
from app.campaigns.schemas import Campaign, Definition, NewCampaign, StopRule
from app.campaigns.trials.record_doubts import Accepted
from app.campaigns.trials.records import plan_and_import
from app.campaigns.trials.schemas import TrialPlan
from app.campaigns.trials.service import evaluate_gate
from app.common.states import CampaignState
from app.core.experiments.takeoff import Takeoff as Experiment
from app.core.tuning.logged_takeoffs import comparable_takeoffs
from app.db.session import Database
from app.fleet import service as fleet
from app.fleet.schemas import VehicleChoice
from app.log_library import repository, stored_logs
from app.log_library.library_schemas import AnalysedContent, LogAnalysis
from app.log_library.takeoffs import logged_takeoffs
from app.processes.calls import FILE, run_limited

EXAMPLE: Final = Path(__file__).parent / "data" / "altitude_steps.bin.gz"
UNNAMED: Final = "Log"
_FURTHER_FLIGHTS: Final = 6
_ANY_RECORD: Final = Accepted(confirm=True, invalid=True)


def analyze_limited(
    content: bytes, companion: bytes | None, *, name: str, gains: str = "", vehicle: int | None = None
) -> AnalysedContent:
    """Analyse a log as below in a process with limits, and store nothing."""
    from app.log_library.content import analyze_content  # noqa: PLC0415 - imports every reader and model

    return run_limited(FILE, analyze_content, content, companion, name, gains, vehicle)


def analyze_upload(
    database: Database,
    content: bytes,
    companion: bytes | None,
    *,
    name: str,
    gains: str = "",
    vehicle: int | None = None,
    analyze: Callable[..., AnalysedContent] = analyze_limited,
) -> LogAnalysis:
    """Analyse a log or trace, by default in a process with limits, and store the answer; if this version has answered
    it before, that one. `companion` is the .log file of Paparazzi's .data file, `gains` those flown, if no log contains
    them, `vehicle` the system id of one of several vehicles.

    Raises InputError that names what is missing or wrong.
    """
    digest = stored_logs.digest_of(content, companion, gains=gains, vehicle=vehicle)
    with database.read() as session:
        if (known := stored_logs.answered(session, digest)) is not None:
            return known
    found = analyze(content, companion, name=name, gains=gains, vehicle=vehicle)
    with database.write() as session:
        log_id = stored_logs.store(session, found, digest, stored_logs.digest_of(content, companion))
    with database.read() as session:  # drawing the figures needs no lock
        return stored_logs.get_analysis(session, log_id)


def analyze_example(database: Database) -> LogAnalysis:
    """Analyse the log that comes with the program."""
    return analyze_upload(database, gzip.decompress(EXAMPLE.read_bytes()), None, name=EXAMPLE.stem)


def read_upload(
    content: bytes, companion: bytes | None, *, name: str, vehicle: int | None = None
) -> Sequence[Takeoff] | Definition:
    """Read what a campaign starts with from an uploaded log, in a process with limits; of one of several vehicles that
    with the system id `vehicle`. Raises InputError that names what is missing or wrong."""
    from app.log_library.content import read_start  # noqa: PLC0415 - imports every reader and model

    return run_limited(FILE, read_start, content, companion, name, vehicle)


def start_of(database: Database, log_id: int) -> tuple[Sequence[Takeoff] | Definition, str]:
    """What a campaign starts with of a stored log, and its name; its takeoffs are in its file alone. Raises
    NotFoundError, also if the file is not stored; InputError if no campaign starts from it."""
    with database.read() as session:
        stored = stored_logs.stored_answer(session, log_id)
        name = stored.answer.file_name
        if stored.definition is not None:
            return stored.definition, name
        file = repository.get_file(session, log_id)
        content, companion = file.content, file.companion
    return read_upload(content, companion, name=name, vehicle=stored.answer.vehicle), name


def start_campaign(
    session: Session,
    found: Sequence[Takeoff] | Definition,
    context: RequestContext,
    *,
    name: str,
    vehicle_id: int | None = None,
) -> Campaign:
    """Create the campaign of a log: a draft for a registered vehicle, by default the only one that flies the steps; or,
    of a vehicle flown elsewhere, one with the takeoffs that an analysis uses, scored over the same window.

    `name` is the log's file name; `vehicle_id` names the registered vehicle. Raises TrajectoryError if no takeoff can
    be used, InputError that names what a record or the vehicle lacks.
    """
    title = PurePath(name).stem.strip() or UNNAMED
    if isinstance(found, Definition):
        vehicle = fleet.registered_for(session, found.experiment, vehicle_id)
        return campaigns.create_campaign(session, NewCampaign(name=title, vehicle=vehicle, definition=found))
    used, window_s = comparable_takeoffs(logged_takeoffs(found, name=name))
    records = {each.number: each for each in found}
    stop = StopRule(max_flights=len(used) + _FURTHER_FLIGHTS)
    definition = Definition(experiment_options={"window_s": window_s}, stop=stop)
    row = campaigns.add_campaign(session, title, definition, VehicleChoice(kind="import"))
    set_campaign_state(row, CampaignState.READY)  # it takes its flights without a proposal
    for each in used:
        passed = evaluate_gate(session, row.id, each.gains).passed  # if not, the record corrects the gains
        planned = dict(each.gains) if passed else Experiment.space.mapping(Experiment.space.default)
        plan = TrialPlan(gains=planned, note=f"Takeoff {each.number} of {name}")
        plan_and_import(session, row.id, plan, records[each.number], context, accepted=_ANY_RECORD)
    return campaigns.get_campaign(session, row.id)
