"""`gainline import`, `report`, `bundle`, `unbundle`: flight logs in, reports out, and whole campaigns in and out."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Final, Literal

import typer
from rich.console import Console
from rich.markup import escape

from app.autopilots.takeoffs import Takeoff
from app.bundles.export import write_bundle
from app.bundles.importer import store_bundle
from app.bundles.reader import Bundle
from app.campaigns import service as campaigns
from app.campaigns.trials import records
from app.campaigns.trials.record_doubts import Accepted
from app.campaigns.trials.schemas import Trial
from app.cli.console import console, reading, write_json, writing
from app.common.errors import InputError, Problem, UnconfirmedError
from app.common.settings import Settings
from app.core.formatting import count, format_gains
from app.db.migrate import require_current
from app.db.session import Database
from app.documents.html import chart_library
from app.logs.formats import companion_of
from app.reports.html import file_name, render
from app.reports.pdf import print_pdf
from app.reports.service import report_of


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
    """Import the flight and print the trial's result; asks before it accepts gains that were not planned, reads the
    record in another unit, or stores it as an invalid flight.

    Raises InputError for a log that cannot be used, UnconfirmedError when the command is not interactive and cannot
    ask.
    """
    flown = _read(file, takeoff)
    out = console(json_out)
    out.print(f"{escape(file.name)}: {escape(flown.summary)}.")
    for note in flown.notes:
        out.print(f"  {escape(note)}", style="dim")
    with open_database(settings) as database:
        stored = _store(database, campaign, trial, flown, yes=yes)
    error = "no error" if stored.error is None else f"error {stored.error:.4f}"
    flight = f"Trial {stored.number} of campaign {stored.campaign_id}"
    out.print(f"{flight}, {format_gains(stored.gains)}: {stored.state}, {error}.")
    if stored.reason:
        out.print(escape(stored.reason))
    for glitch in stored.glitches:
        out.print(escape(glitch.sentence))
    write_json(json_out, stored.model_dump(mode="json"))


@contextmanager
def open_database(settings: Settings) -> Iterator[Database]:
    """The data folder's database. Raises SchemaError unless it is at the program's revision."""
    require_current(settings.database_file)
    with closing(Database(settings.database_file)) as database:
        yield database


def can_ask() -> bool:
    """Whether standard input is a terminal, so that a person can be asked."""
    return sys.stdin.isatty()


def _read(file: Path, takeoff: int | None) -> Takeoff:
    from app.autopilots.log_readers import read_takeoff  # noqa: PLC0415 - imports every reader

    with reading(file, "a log"), ExitStack() as files:
        stream = files.enter_context(file.open("rb"))
        beside = companion_of(file)
        companion = None if beside is None else files.enter_context(beside.open("rb"))
        return read_takeoff(stream, name=file.name, number=takeoff, companion=companion)


def _store(database: Database, campaign: str, trial: int | None, flown: Takeoff, *, yes: bool) -> Trial:
    accepted = Accepted()
    while True:
        try:
            with database.write() as session:
                return records.import_into_campaign(session, campaign, flown, number=trial, accepted=accepted)
        except UnconfirmedError as needed:
            before, accepted = accepted, accepted.answering(needed.problems)
            if accepted == before:
                raise
            if not yes and not can_ask():
                raise UnconfirmedError(needed.message, hint=f"{needed.hint} --yes confirms it.") from needed
            Console(stderr=True, highlight=False).print(f"{escape(needed.message)} {escape(needed.hint)}")
            question = "Import it?" if accepted.reads_as == before.reads_as else "Import it, read so?"
            if not yes and not typer.confirm(question):
                raise


def bundle(campaign: str, settings: Settings, *, out: Path | None) -> None:
    """Write the campaign's bundle; a server may run meanwhile. Raises InputError when the file cannot be written."""
    with open_database(settings) as database, database.read() as session:
        campaign_id = campaigns.find_by_id_or_name(session, campaign)
        target = out or Path(f"campaign-{campaign_id}.gainline.zip")
        arriving = target.with_name(f".{target.name}.part")
        try:
            with writing("--out", target):
                with arriving.open("w+b") as file:
                    write_bundle(session, campaign_id, settings.data_dir, file)
                arriving.replace(target)
        finally:
            arriving.unlink(missing_ok=True)
    console().print(
        f"Campaign {campaign_id} was written to {escape(str(target))} ({target.stat().st_size / 1e6:.1f} MB)."
    )


def unbundle(file: Path, settings: Settings) -> None:
    """Import the campaign and print a summary. Raises InputError that names what is wrong with the file."""
    with (
        reading(file, "a bundle"),
        open_database(settings) as database,
        file.open("rb") as stream,
        Bundle(stream) as opened,
    ):
        opened.check()
        with database.write() as session:
            made = store_bundle(session, opened, settings.data_dir)
    out = console()
    out.print(
        f"Campaign {made.id}, {escape(made.name)}: {count(made.trials.flown, 'flight')} on {escape(made.vehicle.name)}."
    )
    if not made.vehicle.can_fly:
        out.print("It is read-only here: view it, compare it, or clone it to a vehicle that can be flown from here.")


Format = Literal["html", "pdf"]


_FORMATS: Final[Mapping[str, Format]] = {".html": "html", ".htm": "html", ".pdf": "pdf"}


def _format_of(out: Path | None) -> Format:
    """The format that the file's extension names; HTML without a file."""
    if out is None:
        return "html"
    if (found := _FORMATS.get(out.suffix.lower())) is None:
        raise InputError(
            f"The report was not written: the format of {out.name} is unknown.",
            problems=(Problem("--out", "must end in .html, .htm or .pdf"),),
            hint="Change the extension, or choose the format with --format html or --format pdf.",
        )
    return found


def report(campaign: str, settings: Settings, *, out: Path | None, kind: Format | None) -> None:
    """Write the report; a server may run meanwhile. Without `kind` the format follows from the file's extension;
    without a file too it is HTML.

    Raises InputError when the format is unknown or the file cannot be written, UnavailableError when no program to
    print a PDF is installed.
    """
    chosen = kind or _format_of(out)
    with open_database(settings) as database, database.read() as session:
        found = report_of(session, campaigns.find_by_id_or_name(session, campaign))
    html = render(found, chart_library(settings.ui_dir)).html
    content = print_pdf(lambda: html) if chosen == "pdf" else html.encode()
    target = out or Path(file_name(found.campaign.id, chosen))
    with writing("--out", target):
        target.write_bytes(content)
    console().print(f"The report of campaign {found.campaign.id} was written to {escape(str(target))}.")
