"""`gainline run`: a whole campaign without the dashboard, by the same services on a temporary database."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event

import structlog
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

from app.accounts.permissions import LOCAL_CLI
from app.autopilots.registry import experiment_of
from app.campaigns import history, proposals
from app.campaigns import service as campaigns
from app.campaigns.campaign_files import CampaignFile, gains_by_hand
from app.campaigns.computation import compute
from app.campaigns.definitions import check_campaign, stored
from app.campaigns.trials.reviews import classify_trial
from app.campaigns.trials.schemas import Classification, FlightOrder, TrialPlan
from app.campaigns.trials.service import create_trial
from app.campaigns.trials.views import reason_of
from app.cli.console import console, table, write_json
from app.common.data_folder import prepare_data_dir, trial_parameters_folder
from app.common.errors import InputError, Problem
from app.common.states import HISTORY_TRIAL_STATES, CampaignState, TrialState, VehicleState
from app.core.definition import Definition, Interval
from app.core.formatting import format_gains, named_flights, number
from app.core.policy import Gains
from app.core.records.trajectory import CHANNEL_UNITS
from app.db.migrate import migrate
from app.db.models import ProposalRow, TrialRow
from app.db.session import Database
from app.fleet import service as fleet
from app.fleet.registration import register_vehicle
from app.fleet.schemas import NewVehicle, VehicleChoice
from app.flights.runner import DirectFlight, FlightRunner
from app.flights.service import fly_new_trial
from app.flights.worker_part import AbortRegistry, WorkerPart
from app.live.messages import FlightPhase, PublishedMessage, Telemetry
from app.vehicles.base import OptionValue, VehicleError
from app.vehicles.flight_end import end_text
from app.vehicles.registry import get_kind


def run_campaign(file: CampaignFile, *, json_out: Path | None, data_dir: Path, overrule: str = "") -> None:
    """Fly the campaign of a file and print its table.

    When an error ends the campaign, print the flights until then and the gains on the vehicle. What a trial changes on
    a vehicle with a link is kept in `data_dir`. Raises InputError if the campaign cannot be flown, StorageError when
    the folder cannot be used.
    """
    definition, options = check_campaign(file.definition, file.vehicle)
    _require_flyable(file.vehicle, options)
    given = gains_by_hand(file, definition, within_bounds=not overrule)
    folder: Path | None = None
    if get_kind(file.vehicle.kind).connect is not None:
        prepare_data_dir(data_dir)
        folder = trial_parameters_folder(data_dir)
    out = console(json_out)
    display = _Display(definition)

    def report(stopped_because: str) -> None:
        _print(out, file, display, stopped_because)
        write_json(json_out, _document(file, options, display, stopped_because))

    try:
        with display.progress, _logs_to_stderr(), _temporary_database() as database:
            stopped_because = _Campaign(database, file, display, folder).fly(given, overrule)
    except BaseException as error:
        if display.trials or display.touched:
            report(f"an error occurred: {str(error) or type(error).__name__}")
        raise
    report(stopped_because)


def _require_flyable(vehicle: VehicleChoice, options: Mapping[str, OptionValue]) -> None:
    if vehicle.id is not None:
        raise InputError(
            "A registered vehicle cannot be flown from the command line.",
            problems=(Problem("vehicle.id", "names a vehicle of the dashboard's database"),),
            hint="Fly it in the dashboard, or give the address of a simulated one.",
        )
    kind, described = vehicle.kind, get_kind(vehicle.kind)
    if not described.can_fly or described.is_real_with(options):
        raise InputError(
            f"{described.title} cannot be flown from the command line.",
            problems=(Problem("vehicle.kind", f"{kind} is not a simulation"),),
            hint="Choose a simulation: --vehicle jsbsim, twin or lti, or mavlink:ADDRESS --set simulated=true "
            "with an address on this computer. Real vehicles fly only from the dashboard.",
        )


@contextmanager
def _logs_to_stderr() -> Iterator[None]:
    """Print what the flight runner logs as an error; standard output may carry the JSON."""
    before = structlog.get_config()
    structlog.configure(
        wrapper_class=structlog.make_filtering_bound_logger("error"),
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )
    try:
        yield
    finally:
        structlog.configure(**before)


@contextmanager
def _temporary_database() -> Iterator[Database]:
    with TemporaryDirectory(prefix="gainline-") as folder:
        file = Path(folder) / "gainline.sqlite3"
        migrate(file)
        with closing(Database(file)) as database:
            yield database


class _Campaign:
    """The campaign in the database, computed and flown in this process as the worker does it in its own.

    `trial_parameters` is as in `open_vehicle`.
    """

    def __init__(
        self, database: Database, file: CampaignFile, display: "_Display", trial_parameters: Path | None
    ) -> None:
        self._database = database
        self._display = display
        self._flight = DirectFlight(display.hear, display.hold, trial_parameters)
        self._runner = FlightRunner(
            WorkerPart(
                database=database,
                data_dir=database.file.parent,
                abort_registry=AbortRegistry(),
                publish=display.hear,
                worker="gainline run",
                closing=Event(),
            ),
            session=lambda _vehicle_id: self._flight,
            pool=None,
        )
        kind = get_kind(file.vehicle.kind)
        with database.write() as session:
            if kind.connect is None:
                self._id = campaigns.create_campaign(session, file).id
                return
            space = display.experiment.space
            safe_gains = space.mapping(space.default)
            new = NewVehicle(name=kind.name, kind=kind.name, options=file.vehicle.options, safe_gains=safe_gains)
            choice = VehicleChoice(kind=kind.name, id=register_vehicle(session, new, LOCAL_CLI).id)
            self._id = campaigns.create_campaign(session, file.model_copy(update={"vehicle": choice})).id
            # Ready without a connection: the link is opened for each flight.
            fleet.set_vehicle_state(campaigns.get_row(session, self._id).vehicle, VehicleState.READY)

    def fly(self, given: Sequence[Gains], overrule: str) -> str:
        """Fly proposals until the campaign is finished, or the given gain sets until all are flown; return why it ends.

        Raises GainsError when the gate refuses the gains, unless `overrule` is a reason, and VehicleError when the
        vehicle cannot fly.
        """
        while True:
            proposal, finished = self._propose()
            trials = self._display.trials
            if finished is not None:
                return finished
            if len(trials) >= self._display.definition.stop.max_flights:
                unscored = sum(trial.state not in HISTORY_TRIAL_STATES for trial in trials)
                return f"All {len(trials)} flights have been flown; {unscored} of them could not be scored."
            if given and len(trials) == len(given):
                return f"All {len(given)} given gain sets have been flown."
            # Built without the API's limits on text: a reason on the command line may be of any length.
            new = TrialPlan.model_construct(
                proposal_id=None if given else proposal.id,
                gains=dict(given[len(trials)]) if given else None,
                overrule=overrule or None,
            )
            flown = self._fly_trial(new)
            self._display.landed(flown, flown.kind if given else proposal.kind)

    def _propose(self) -> tuple[ProposalRow, str | None]:
        """Compute and store the next proposal; return it, and why the campaign is finished if it is."""
        with self._database.read() as session:
            past = proposals.read_history(session, self._id)
        computed = compute(past)
        with self._database.write() as session:
            proposal = proposals.store_proposal(session, self._id, computed)
            campaign = campaigns.get_row(session, self._id)
            return proposal, campaign.stop_reason if campaign.state == CampaignState.FINISHED else None

    def _fly_trial(self, new: TrialPlan) -> TrialRow:
        """Fly one trial and classify it. A flight with glitches does not count, because no person reviews it."""
        with self._database.write() as session:
            planned = create_trial(session, self._id, new)
            fly_new_trial(session, planned.id, FlightOrder(speed=None))
        request = self._runner.claim()
        assert request is not None
        self._display.planned(planned.number, request.gains)
        self._runner.carry_out(request)
        if self._flight.error is not None:
            raise self._flight.error
        with self._database.write() as session:
            trial = history.trial_row(session, request.trial_id)
            if trial.trajectory is None:
                end = history.latest_flights(session, [trial.id])[trial.id].end
                raise VehicleError(f"Flight {trial.number}: {end_text(end)}", hint="Correct this, then run it again.")
            if trial.state == TrialState.CAPTURED:
                reason = " ".join(glitch["sentence"] for glitch in trial.glitches or ())
                invalid = Classification.model_construct(version=trial.version, outcome="invalid", reason=reason)
                classify_trial(session, trial.id, invalid)
        return trial


class _Display:
    """Progress line of the running flight, on standard error; finished flights are printed above it.

    `kinds` are those of the flights' proposals, which can be `none`: the strategy proposed no further step.
    `touched`: whether any gains were written to the vehicle. `held`: the gains last read back, None while unknown.
    """

    def __init__(self, definition: Definition) -> None:
        self.definition = definition
        self.experiment = experiment_of(definition)
        self.progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[note]}"),
            console=Console(stderr=True),
            transient=True,
        )
        lasts_s = float(self.experiment.grid_s[-1])
        self._task = self.progress.add_task("computing the first gains", total=lasts_s, note="")
        self.trials: list[TrialRow] = []
        self.kinds: list[str] = []
        self.touched = False
        self.held: Mapping[str, float] | None = None

    def hold(self, gains: Mapping[str, float] | None) -> None:
        self.touched, self.held = True, gains

    def planned(self, number: int, gains: Gains) -> None:
        self.progress.update(
            self._task,
            completed=0.0,
            note="",
            description=f"flight {number} of at most {self.definition.stop.max_flights}, {format_gains(gains)}",
        )

    def hear(self, message: PublishedMessage) -> None:
        match message:
            case Telemetry(samples=[*_, [time_s, output, *_]]):
                unit = CHANNEL_UNITS[self.experiment.output]
                self.progress.update(self._task, completed=time_s, note=f"{output:.2f} {unit}")
            case FlightPhase(note=note) if note:
                self.progress.update(self._task, note=note)

    def landed(self, trial: TrialRow, kind: str) -> None:
        self.trials.append(trial)
        self.kinds.append(kind)
        error = "no error" if trial.error is None else f"{trial.error:.4f} {self.experiment.error_unit}"
        self.progress.console.print(
            f"flight {trial.number}: {format_gains(trial.gains)} → {error} "
            f"({trial.state}{f': {reason}' if (reason := reason_of(trial)) else ''})",
            highlight=False,
        )
        self.progress.update(self._task, description="computing the next gains", completed=0.0, note="")


def _print(out: Console, file: CampaignFile, display: _Display, stopped_because: str) -> None:
    names = display.experiment.space.names
    unit = display.experiment.error_unit
    best = history.best_of(display.trials)
    rows = [
        (
            f"flight {trial.number}",
            number(trial.error, 4),
            number(_prediction(trial, display.trials)[0], 4),
            *(f"{trial.gains[name]:g}" for name in names),
            kind,
            "best"
            if best is not None and trial.number == best.number
            else ""
            if trial.state == TrialState.VALID
            else trial.state.value,
        )
        for trial, kind in zip(display.trials, display.kinds, strict=True)
    ]
    out.print(table(("flight", f"error ({unit})", f"predicted ({unit})", *names, "step", ""), rows, title=file.name))
    if overruled := [trial.number for trial in display.trials if trial.overrule_reason]:
        out.print(f"Gate overruled: {named_flights(overruled)}.")
    out.print(f"Stopped: {stopped_because}")
    if best is not None:
        out.print(f"Best: {best.error:.4f} {unit} with {format_gains(best.gains)}, flight {best.number}.")
    if not get_kind(file.vehicle.kind).is_real:
        return  # a new vehicle for each flight
    if display.held is not None:
        out.print(f"The safe gains are restored and read back: {format_gains(display.held)}.")
    elif display.touched:
        out.print("The gains on the vehicle are unknown. Read them back manually before it flies again.")


def _document(
    file: CampaignFile, options: Mapping[str, OptionValue], display: _Display, stopped_because: str
) -> dict[str, object]:
    best = history.best_of(display.trials)
    predictions = [_prediction(trial, display.trials) for trial in display.trials]
    return {
        "name": file.name,
        "vehicle": {"kind": file.vehicle.kind, "options": dict(options)},
        "definition": stored(display.definition),
        "definition_digest": display.definition.digest(),
        "trials": [
            {
                "number": trial.number,
                "kind": kind,
                "gains": trial.gains,
                "outcome": trial.state.value,
                "error": trial.error,
                "predicted_error": error,
                "reason": reason_of(trial),
                "predicted_interval": None if interval is None else asdict(interval),
                "overrule_reason": trial.overrule_reason,
            }
            for trial, kind, (error, interval) in zip(display.trials, display.kinds, predictions, strict=True)
        ],
        "best": None if best is None else best.number,
        "stopped_because": stopped_because,
    }


def _prediction(trial: TrialRow, trials: Sequence[TrialRow]) -> tuple[float | None, Interval | None]:
    """The trial's predicted error and interval, as in the API."""
    return history.told_prediction(
        trial.predicted_error, trial.predicted_interval, corrected=history.is_corrected(trials, trial.number)
    )
