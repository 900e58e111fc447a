"""`gainline bundle` and `gainline unbundle`: export and import of a campaign as one file."""

from pathlib import Path

from rich.markup import escape

from app.bundles.reading import Bundle
from app.bundles.service import store_bundle, write_bundle
from app.campaigns import service as campaigns
from app.commands.console import console
from app.common.errors import InputError, Problem
from app.common.settings import Settings
from app.db.migrate import require_current
from app.db.session import Database
from app.reports.wording import count


def bundle(campaign: str, settings: Settings, *, out: Path | None) -> None:
    """Write the campaign's bundle; a server may run meanwhile. Raises InputError when the file cannot be written."""
    require_current(settings.database_file)
    database = Database(settings.database_file)
    try:
        with database.read() as session:
            campaign_id = campaigns.find_by_id_or_name(session, campaign)
            target = out or Path(f"campaign-{campaign_id}.gainline.zip")
            arriving = target.with_name(f".{target.name}.part")
            try:
                with arriving.open("w+b") as file:
                    write_bundle(session, campaign_id, settings.data_dir, file)
                arriving.replace(target)
            except OSError as error:
                raise InputError(
                    f"{target} could not be written: {error.strerror or error}.",
                    problems=(Problem("--out", "cannot be written"),),
                    hint="Name a file in a folder that exists and has room.",
                ) from error
            finally:
                arriving.unlink(missing_ok=True)
    finally:
        database.close()
    console().print(f"Campaign {campaign_id} is in {escape(str(target))}, {target.stat().st_size / 1e6:.1f} MB.")


def unbundle(file: Path, settings: Settings) -> None:
    """Import the campaign and print a summary. Raises InputError that names what is wrong with the file."""
    require_current(settings.database_file)
    database = Database(settings.database_file)
    try:
        with file.open("rb") as stream, Bundle(stream) as opened:
            opened.check()
            with database.write() as session:
                made = store_bundle(session, opened, settings.data_dir)
    except OSError as error:
        raise InputError(
            f"{file} could not be read: {error.strerror or error}.",
            problems=(Problem("FILE", "cannot be read"),),
            hint="Give a bundle that this user may read.",
        ) from error
    finally:
        database.close()
    out = console()
    out.print(
        f"Campaign {made.id}, {escape(made.name)}: {count(made.trials.flown, 'flight')} on {escape(made.vehicle.name)}."
    )
    if not made.vehicle.can_fly:
        out.print("It is history here: it can be read, compared and cloned to a vehicle that flies.")
