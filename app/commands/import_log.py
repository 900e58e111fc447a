"""`gainline import`: import of a flight's log into the trial that waits for it."""

import sys
from contextlib import ExitStack
from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape

from app.campaigns.trials import records
from app.campaigns.trials.schemas import Trial
from app.commands.console import console, write_json
from app.common.errors import InputError, Problem, UnconfirmedError
from app.common.settings import Settings
from app.db.migrate import require_current
from app.db.session import Database
from app.logs.takeoffs import Takeoff


def import_log(
    file: Path,
    settings: Settings,
    *,
    campaign: str,
    trial: int | None,
    takeoff: int | None,
    yes: bool,
    json_out: Path | None,
) -> None:
    """Import the flight and print the trial's result; asks before it accepts gains that were not planned.

    Raises InputError for a log that cannot be used, UnconfirmedError when the command is not interactive and cannot
    ask.
    """
    flown = _read(file, takeoff)
    out = console(json_out)
    out.print(f"{escape(file.name)}: {escape(flown.summary)}.")
    for note in flown.notes:
        out.print(f"  {escape(note)}", style="dim")
    require_current(settings.database_file)
    database = Database(settings.database_file)
    try:
        stored = _store(database, campaign, trial, flown, yes=yes)
    finally:
        database.close()
    _print(out, stored)
    write_json(json_out, stored.model_dump(mode="json"))


def can_ask() -> bool:
    """Whether standard input is a terminal, so that a person can be asked."""
    return sys.stdin.isatty()


def _read(file: Path, takeoff: int | None) -> Takeoff:
    try:
        with ExitStack() as files:
            stream = files.enter_context(file.open("rb"))
            beside = file.with_suffix(".log")
            companion = (
                files.enter_context(beside.open("rb")) if file.suffix.lower() == ".data" and beside.is_file() else None
            )
            return records.read_record(stream, name=file.name, takeoff=takeoff, companion=companion)
    except OSError as error:
        raise InputError(
            f"{file} could not be read: {error.strerror or error}.",
            problems=(Problem("FILE", "cannot be read"),),
            hint="Give a log that this user may read.",
        ) from error


def _store(database: Database, campaign: str, trial: int | None, flown: Takeoff, *, yes: bool) -> Trial:
    def attempt(confirmed: bool) -> Trial:
        with database.write() as session:
            return records.import_into_campaign(session, campaign, flown, number=trial, confirmed=confirmed)

    try:
        return attempt(yes)
    except UnconfirmedError as needed:
        if not can_ask():
            raise UnconfirmedError(needed.message, hint=f"{needed.hint} --yes confirms it.") from needed
        Console(stderr=True, highlight=False).print(f"{escape(needed.message)} {escape(needed.hint)}")
        if not typer.confirm("Take it?"):
            raise
        return attempt(True)


def _print(out: Console, trial: Trial) -> None:
    gains = ", ".join(f"{name} {value:g}" for name, value in trial.gains.items())
    error = "no error" if trial.error is None else f"error {trial.error:.4f}"
    out.print(f"Trial {trial.number} of campaign {trial.campaign_id}, {gains}: {trial.state}, {error}.")
    if trial.reason:
        out.print(escape(trial.reason))
    for glitch in trial.glitches:
        out.print(escape(glitch.sentence))
