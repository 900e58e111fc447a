"""`gainline run`: a whole campaign without the dashboard."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

from app.campaigns.campaign_files import (
    CampaignFile,
    gains_by_hand,
    override,
    preset_names,
    read_campaign_file,
    read_preset,
)
from app.campaigns.definitions import check_campaign, stored
from app.campaigns.headless import CampaignListener, HeadlessCampaign, HeadlessTrial, fly_campaign
from app.cli.console import console, table, write_json
from app.common.data_folder import prepare_data_dir, trial_parameters_folder
from app.common.errors import InputError, Problem
from app.core.definition import Definition
from app.core.experiments import experiment_of
from app.core.experiments.base import Experiment
from app.core.formatting import format_gains, number
from app.core.records.trajectory import CHANNEL_UNITS
from app.core.tuning.strategy import Proposal
from app.fleet.schemas import VehicleChoice
from app.vehicles.base import OptionValue, Sample
from app.vehicles.registry import get_kind


def run_campaign(
    source: str,
    *,
    vehicle: str | None,
    strategy: str | None,
    start: str | None,
    seed: int | None,
    max_flights: int | None,
    gains: Sequence[str],
    settings: Sequence[str],
    json_out: Path | None,
    data_dir: Path,
    overrule: str = "",
) -> None:
    """Fly the campaign of a preset or file and print its table.

    When an error ends the campaign, print the flights until then and the gains on the vehicle. What a trial changes on
    a vehicle with a link is kept in `data_dir`. Raises InputError if the campaign cannot be flown, StorageError when
    the folder cannot be used.
    """
    file = override(
        _read(source),
        vehicle=vehicle,
        strategy=strategy,
        start=start,
        seed=seed,
        max_flights=max_flights,
        gains=gains,
        settings=settings,
    )
    definition, options = check_campaign(file.definition, file.vehicle)
    _require_flyable(file.vehicle, options)
    experiment = experiment_of(definition)
    given = gains_by_hand(file, definition, within_bounds=not overrule)
    folder: Path | None = None
    if get_kind(file.vehicle.kind).connect is not None:
        prepare_data_dir(data_dir)
        folder = trial_parameters_folder(data_dir)
    out = console(json_out)
    display = _Display(definition, experiment)
    try:
        with display:
            campaign = fly_campaign(
                definition,
                file.vehicle.kind,
                options,
                display.watcher,
                gains=given,
                overrule=overrule,
                trial_parameters=folder,
            )
    except BaseException as error:
        campaign = display.broken_off(error)
        if campaign.trials or display.touched:
            _print(out, file, experiment, campaign)
            _print_held(out, file, display)
            write_json(json_out, _document(file, definition, options, campaign))
        raise
    _print(out, file, experiment, campaign)
    _print_held(out, file, display)
    write_json(json_out, _document(file, definition, options, campaign))


def _read(source: str) -> CampaignFile:
    return read_preset(source) if source in preset_names() else read_campaign_file(Path(source))


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


class _Display:
    """Progress line of the running flight, on standard error; finished flights are printed above it.

    `touched`: whether any gains were written to the vehicle. `held`: the gains last read back, None while unknown.
    """

    def __init__(self, definition: Definition, experiment: Experiment) -> None:
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[note]}"),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._progress.add_task("computing the first gains", total=float(experiment.grid_s[-1]), note="")
        self._limit = definition.stop.max_flights
        self._unit = experiment.error_unit
        self._output, self._output_unit = experiment.output, CHANNEL_UNITS[experiment.output]
        self._trials: list[HeadlessTrial] = []
        self.touched = False
        self.held: Mapping[str, float] | None = None
        self.watcher = CampaignListener(
            proposed=self._proposed, sampled=self._sampled, landed=self._landed, holding=self._holding
        )

    def broken_off(self, error: BaseException) -> HeadlessCampaign:
        """The campaign with the flights until the error."""
        message = str(error) or type(error).__name__
        return HeadlessCampaign(trials=tuple(self._trials), stopped_because=f"After an error: {message}")

    def _holding(self, gains: Mapping[str, float] | None) -> None:
        self.touched, self.held = True, gains

    def __enter__(self) -> "_Display":
        self._progress.start()
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def _proposed(self, number: int, proposal: Proposal) -> None:
        self._progress.update(
            self._task,
            completed=0.0,
            note="",
            description=f"flight {number} of at most {self._limit}, {format_gains(proposal.gains)}",
        )

    def _sampled(self, sample: Sample) -> None:
        self._progress.update(
            self._task, completed=sample.time_s, note=f"{sample[self._output]:.2f} {self._output_unit}"
        )

    def _landed(self, trial: HeadlessTrial) -> None:
        self._trials.append(trial)
        self._progress.console.print(
            f"flight {trial.number}: {format_gains(trial.gains)} → {_error(trial.error, self._unit)} "
            f"({_describe_outcome(trial)})",
            highlight=False,
        )
        self._progress.update(self._task, description="computing the next gains", completed=0.0, note="")


def _print(out: Console, file: CampaignFile, experiment: Experiment, campaign: HeadlessCampaign) -> None:
    names = experiment.space.names
    unit = experiment.error_unit
    best = campaign.best
    rows = [
        (
            f"run {trial.number}",
            number(trial.error, 4),
            number(trial.predicted_error, 4),
            *(f"{trial.gains[name]:g}" for name in names),
            trial.kind,
            "best"
            if best is not None and trial.number == best.number
            else ""
            if trial.outcome == "valid"
            else trial.outcome,
        )
        for trial in campaign.trials
    ]
    out.print(table(("run #", f"error ({unit})", f"predicted ({unit})", *names, "step", ""), rows, title=file.name))
    if overruled := [str(trial.number) for trial in campaign.trials if trial.overrule_reason]:
        out.print(f"Refused by the gate and flown with a reason: flight {', '.join(overruled)}.")
    out.print(f"Stopped: {campaign.stopped_because}")
    if best is not None:
        out.print(f"Best: {_error(best.error, unit)} with {format_gains(best.gains)}, flight {best.number}.")


def _print_held(out: Console, file: CampaignFile, display: _Display) -> None:
    """Print the gains on a vehicle with a link; any other vehicle is a new one for each flight."""
    if not get_kind(file.vehicle.kind).is_real:
        return
    if display.held is not None:
        out.print(f"The safe gains are restored and read back: {format_gains(display.held)}.")
    elif display.touched:
        out.print("The gains on the vehicle are unknown. Read them back manually before it flies again.")


def _document(
    file: CampaignFile, definition: Definition, options: Mapping[str, OptionValue], campaign: HeadlessCampaign
) -> dict[str, object]:
    best = campaign.best
    return {
        "name": file.name,
        "vehicle": {"kind": file.vehicle.kind, "options": dict(options)},
        "definition": stored(definition),
        "definition_digest": definition.digest(),
        "trials": [{**asdict(trial), "gains": dict(trial.gains)} for trial in campaign.trials],
        "best": None if best is None else best.number,
        "stopped_because": campaign.stopped_because,
    }


def _describe_outcome(trial: HeadlessTrial) -> str:
    return f"{trial.outcome}: {trial.reason}" if trial.reason else trial.outcome


def _error(value: float | None, unit: str) -> str:
    return "no error" if value is None else f"{value:.4f} {unit}"
