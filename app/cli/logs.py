"""`gainline logs`: the log library on the data folder, beside a server that may run."""

from pathlib import Path
from typing import Final

import typer
from pydantic import ValidationError
from rich.console import Console

from app.cli.console import console, shown, table, write_json, writing
from app.cli.files import open_database
from app.cli.log_analysis import print_answer, read_log, write_parameters
from app.common.errors import InputError, Problem
from app.common.schemas import uploaded_name
from app.common.settings import Settings
from app.db.base import utc_now
from app.db.pages import Part
from app.documents.html import chart_library
from app.log_library import comparisons, documents, service, stored_logs
from app.log_library.content import analyze_content
from app.log_library.library_schemas import AnalysedLog, LogPlace, VehicleName
from app.log_library.texts import NUMBERS, answers_nothing, changed_texts, measured_texts, number_texts

_ALL: Final = Part(limit=2**31)


def add_log(
    file: Path, settings: Settings, *, vehicle: str | None, gains: str, system: int | None, keep_file: bool
) -> None:
    """Analyse a log, store the answer, and keep it for the vehicle of that name, else the one with its hardware id.

    Raises InputError for a file that cannot be read and for a name that no vehicle may have, ConflictError where the
    log cannot be kept or its file not be stored; exits with 1 for a log that answers nothing.
    """
    wanted = None if vehicle is None else _name(vehicle)
    content, companion = read_log(file)
    name = uploaded_name(file.name, unnamed=service.UNNAMED)
    out, began, quota = console(), utc_now(), settings.log_file_bytes
    with open_database(settings) as database:
        found = service.analyze_upload(
            database, content, companion, name=name, gains=gains, vehicle=system, analyze=analyze_content
        )
        print_answer(out, found)
        place = found.log
        if place.analysed_at < began:
            out.print(f"This log was analysed before, on {place.analysed_at:%Y-%m-%d %H:%M} UTC.")
        if wanted is None and place.vehicle is None and place.is_recognised:
            wanted = place.suggested_name
        if wanted is not None:
            with database.write() as session:
                place = stored_logs.keep(session, place.id, wanted)
        if keep_file:  # in a transaction of its own: without room for it, the log is kept nevertheless
            with database.write() as session:
                place = stored_logs.store_file(session, place.id, content, companion, quota_bytes=quota)
    _print_place(out, place)
    if answers_nothing(found):
        raise typer.Exit(1)


def list_logs(settings: Settings, *, vehicle: str | None) -> None:
    """Print the logs of a vehicle, or all with those that are not kept. Raises NotFoundError for an unknown vehicle."""
    with open_database(settings) as database, database.read() as session:
        wanted = None if vehicle is None else stored_logs.vehicle_id_of(session, vehicle)
        kept, others = (stored_logs.list_logs(session, _ALL, vehicle_id=wanted, kept=each) for each in (True, False))
    if rows := [_row(log) for log in (*kept.items, *others.items)]:
        columns = ("Log", "File", "Vehicle", "Flown (UTC)", "Grade", *NUMBERS)
        console().print(table(columns, rows, title="Analysed logs"))
    else:
        console().print("There is no log yet. `gainline logs add FILE` adds one.")


def _row(log: AnalysedLog) -> tuple[str, ...]:
    vehicle = log.vehicle.name if log.vehicle else "not kept"
    flown = f"{log.flown_at:%Y-%m-%d %H:%M}" if log.flown_at else "unknown"
    return str(log.id), log.file_name, vehicle, flown, log.grade, *number_texts(log.numbers)


def show_log(
    log_id: int, settings: Settings, *, json_out: Path | None, params_out: Path | None, html_out: Path | None
) -> None:
    """Print a stored answer, and write it where asked for.

    Raises NotFoundError; StorageError for a damaged answer; InputError where a file cannot be written, and for a
    parameter file where nothing is proposed.
    """
    out = console(json_out)
    with open_database(settings) as database, database.read() as session:
        found = stored_logs.get_analysis(session, log_id)
        print_answer(out, found)
        _print_place(out, found.log)
        write_json(json_out, stored_logs.export(session, log_id).model_dump(mode="json"))
        if html_out is not None:
            document = documents.document_of(session, log_id, chart_library(settings.ui_dir))
            with writing("--html", html_out):
                html_out.write_text(document.html, encoding="utf-8")
    write_parameters(params_out, found.texts.tuning)


def compare_logs(log_id: int, settings: Settings, *, before: int | None) -> None:
    """Print a log beside an earlier one. Raises NotFoundError, and InputError without an earlier one."""
    with open_database(settings) as database, database.read() as session:
        found = comparisons.compare(session, log_id, before)
    out, columns = console(), ("", f"log {found.before.id}", f"log {found.log.id}")
    out.print(shown(f"{found.log.file_name} compared with {found.before.file_name}: {found.verdict or 'same gains'}."))
    for sentence in filter(None, (found.sentence, *found.notes)):
        out.print(shown(sentence))
    out.print(table(columns, measured_texts(found), title="Measured"))
    if changed := changed_texts(found):
        out.print(table((*columns, "kind"), changed, title="Parameters that differ"))
    else:
        out.print("No parameter differs.")


def _print_place(out: Console, log: LogPlace) -> None:
    kept = f"kept as a flight of {log.vehicle.name}" if log.vehicle else "not kept, and deleted after seven days"
    out.print(shown(f"Log {log.id}, {kept}{', with its file' if log.file_bytes else ''}."))
    if log.vehicle is None:
        suggested = f" The log names its vehicle {log.suggested_name}." if log.suggested_name else ""
        out.print(shown(f"`gainline logs add FILE --vehicle NAME` keeps it.{suggested}"))


def _name(given: str) -> str:
    """A vehicle's name as it is stored. Raises InputError for one that no vehicle may have."""
    try:
        return VehicleName(name=given).name
    except ValidationError as error:
        problems = tuple(Problem("--vehicle", each["msg"]) for each in error.errors())
        raise InputError("No log was added.", hint="Choose another name for its vehicle.", problems=problems) from error
