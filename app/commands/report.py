"""`gainline report`: a campaign's report as a file."""

from pathlib import Path
from typing import Literal

from rich.markup import escape

from app.campaigns import service as campaigns
from app.commands.console import console
from app.common.errors import InputError, Problem
from app.common.settings import Settings
from app.db.migrate import require_current
from app.db.session import Database
from app.reports.printing import print_pdf
from app.reports.rendering import chart_library, file_name, render
from app.reports.service import report_of

Format = Literal["html", "pdf"]


def report(campaign: str, settings: Settings, *, out: Path | None, kind: Format | None) -> None:
    """Write the report; a server may run meanwhile. Without `kind` the format follows from the file's extension, else
    HTML.

    Raises InputError when the file cannot be written, UnavailableError when no program to print a PDF is installed.
    """
    chosen: Format = kind or ("pdf" if out is not None and out.suffix.lower() == ".pdf" else "html")
    require_current(settings.database_file)
    database = Database(settings.database_file)
    try:
        with database.read() as session:
            found = report_of(session, campaigns.find_by_id_or_name(session, campaign))
    finally:
        database.close()
    html = render(found, chart_library(settings.ui_dir)).html
    content = print_pdf(lambda: html) if chosen == "pdf" else html.encode()
    target = out or Path(file_name(found.campaign.id, chosen))
    try:
        target.write_bytes(content)
    except OSError as error:
        raise InputError(
            f"{target} could not be written: {error.strerror or error}.",
            problems=(Problem("--out", "cannot be written"),),
            hint="Name a file in a folder that exists and has room.",
        ) from error
    console().print(f"The report of campaign {found.campaign.id} is in {escape(str(target))}.")
