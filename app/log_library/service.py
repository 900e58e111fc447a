"""Operations on logs: analyse one of any autopilot, which stores nothing, and create a campaign from one."""

from collections.abc import Sequence
from pathlib import PurePath
from typing import Final, get_args

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
from app.figures.base import card_of
from app.figures.panels import PanelsFigure
from app.figures.theme import ThemeName
from app.fleet import service as fleet
from app.fleet.schemas import VehicleChoice
from app.log_library.schemas import LogAnalysis
from app.log_library.takeoffs import logged_takeoffs
from app.processes.calls import FILE, run_limited
from app.reproductions.controller import RECORDED_TAKEOFF

UNNAMED: Final = "Log"
_FURTHER_FLIGHTS: Final = 6
_ANY_RECORD: Final = Accepted(confirm=True, invalid=True)


def analyze_upload(
    content: bytes, companion: bytes | None, *, name: str, gains: str = "", vehicle: int | None = None
) -> LogAnalysis:
    """Analyse an uploaded log or trace in a process with limits. `companion` is the .log file of Paparazzi's .data
    file, `gains` those flown, if no log contains them, `vehicle` the system id of one of several vehicles.

    Raises InputError that names what is missing or wrong.
    """
    from app.log_library.content import analyze_content  # noqa: PLC0415 - imports every reader and model

    answer, plots = run_limited(FILE, analyze_content, content, companion, name, gains, vehicle)
    figures = {
        theme: {
            part: [card_of(PanelsFigure(plot, theme_name=theme)) for plot in drawn] for part, drawn in plots.items()
        }
        for theme in get_args(ThemeName)
    }
    return LogAnalysis(**dict(answer), figures=figures)


def analyze_example() -> LogAnalysis:
    """Analyse the takeoff that comes with the program, recorded from the autopilot's own code."""
    return analyze_upload(RECORDED_TAKEOFF.read_bytes(), None, name=RECORDED_TAKEOFF.name)


def read_upload(
    content: bytes, companion: bytes | None, *, name: str, vehicle: int | None = None
) -> Sequence[Takeoff] | Definition:
    """Read what a campaign starts with from an uploaded log, in a process with limits; of one of several vehicles that
    with the system id `vehicle`. Raises InputError that names what is missing or wrong."""
    from app.log_library.content import read_start  # noqa: PLC0415 - imports every reader and model

    return run_limited(FILE, read_start, content, companion, name, vehicle)


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
