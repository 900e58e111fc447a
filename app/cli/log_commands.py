"""The commands of `gainline logs`."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import DataDir, FlownGains, GivenLog, JsonOut, ParametersOut, settings_of

LogId = Annotated[int, typer.Argument(metavar="ID", min=1, help="Number of the log, from `gainline logs list`.")]
SystemId = Annotated[int | None, typer.Option(metavar="ID", help="System id, if a log has several vehicles.")]
Before = Annotated[int | None, typer.Option(metavar="ID", min=1, show_default="the log before it", help="Earlier log.")]
HtmlOut = Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Write all of it as one HTML file.")]
logs = typer.Typer(no_args_is_help=True, help="Keep flight logs as flights of a vehicle, and compare them.")


@logs.command()
def add(
    log: GivenLog,
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            show_default="the one with the log's hardware id",
            help="Keep the log as a flight of this vehicle. A log that is not kept is deleted after seven days.",
        ),
    ] = None,
    gains: FlownGains = "",
    system: SystemId = None,
    keep_file: Annotated[bool, typer.Option("--keep-file", help="Store the file of the log, too.")] = False,
    data_dir: DataDir = None,
) -> None:
    """Analyse a log as `gainline analyze` does, and store the answer."""
    from app.cli.logs import add_log

    settings = settings_of(data_dir=data_dir)
    add_log(log, settings, vehicle=vehicle, gains=gains, system=system, keep_file=keep_file)


@logs.command("list")
def list_logs(
    vehicle: Annotated[str | None, typer.Option(metavar="NAME", help="Only the logs of this vehicle.")] = None,
    data_dir: DataDir = None,
) -> None:
    """Print the logs, newest flight first; then those that are not kept."""
    from app.cli.logs import list_logs as run

    run(settings_of(data_dir=data_dir), vehicle=vehicle)


@logs.command()
def show(
    log: LogId, html: HtmlOut = None, params: ParametersOut = None, json_out: JsonOut = None, data_dir: DataDir = None
) -> None:
    """Print the answer to a log, and write it where asked for."""
    from app.cli.logs import show_log

    show_log(log, settings_of(data_dir=data_dir), json_out=json_out, params_out=params, html_out=html)


@logs.command()
def compare(log: LogId, before: Before = None, data_dir: DataDir = None) -> None:
    """Print what changed between two logs of a vehicle: what was measured, every parameter, and what that did."""
    from app.cli.logs import compare_logs

    compare_logs(log, settings_of(data_dir=data_dir), before=before)
