"""The `gainline` command. Each command imports what it needs when it runs, so that help comes at once."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperGroup

from app.cli.log_commands import logs
from app.cli.options import (
    CampaignSource,
    DataDir,
    FlownGains,
    GivenCampaign,
    GivenGains,
    GivenLog,
    GivenSettings,
    JsonOut,
    Overrule,
    ParametersOut,
    Reproducible,
    StartGains,
    settings_of,
)
from app.core.errors import GainlineError


class _Reporting(TyperGroup):
    """Commands whose errors, the program's own ones, are printed for a person, with exit code 1."""

    def invoke(self, ctx: Any) -> Any:  # of a type that typer does not export
        try:
            return super().invoke(ctx)
        except GainlineError as error:
            from app.cli.console import show_error

            show_error(error)
            raise typer.Exit(1) from error


app = typer.Typer(
    name="gainline",
    cls=_Reporting,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Tune a drone's controller gains in a few flights.",
)
app.add_typer(logs, name="logs")


@app.command()
def serve(
    host: Annotated[
        str | None,
        typer.Option(
            show_default="GAINLINE_HOST, else 127.0.0.1",
            help="Address to listen on. 0.0.0.0 admits other devices, such as a tablet: anyone who can reach "
            "this computer over the network can then view every campaign, and browsers unlocked with "
            "`gainline unlock` can change campaigns and fly simulations; vehicles with a link cannot be flown.",
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, show_default="GAINLINE_PORT, else 8000", help="Port; 0 selects a free one."),
    ] = None,
    data_dir: DataDir = None,
    worker: Annotated[bool, typer.Option(help="Also start the worker, which flies and computes.")] = True,
) -> None:
    """Serve the dashboard and its API until stopped."""
    from app.runtime.serve import serve as run

    run(settings_of(host=host, port=port, data_dir=data_dir), with_worker=worker)


@app.command()
def unlock(
    script: Annotated[
        bool, typer.Option("--script", help="Print a script's token instead, to send as `Authorization: Bearer TOKEN`.")
    ] = False,
    data_dir: DataDir = None,
) -> None:
    """Print a link that lets one browser command the real vehicles of the running server."""
    from app.cli.unlock import unlock as run

    run(settings_of(data_dir=data_dir), script=script)


@app.command()
def worker(data_dir: DataDir = None) -> None:
    """Run the worker for a server that was started with --no-worker."""
    from app.runtime.worker import run_worker

    run_worker(settings_of(data_dir=data_dir))


@app.command()
def run(
    campaign: CampaignSource,
    vehicle: Annotated[
        str | None, typer.Option(help="jsbsim, twin, lti, or mavlink:ADDRESS with --set simulated=true.")
    ] = None,
    strategy: Annotated[str | None, typer.Option(help="Strategy that computes the next gains.")] = None,
    start: StartGains = None,
    gains: GivenGains = None,
    settings: GivenSettings = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers.")] = None,
    max_flights: Annotated[int | None, typer.Option(min=1, max=200, help="Maximum number of flights.")] = None,
    overrule: Overrule = "",
    json_out: JsonOut = None,
    data_dir: DataDir = None,
) -> None:
    """Fly a whole campaign on a simulation, without the dashboard, and print its table."""
    from app.campaigns.campaign_files import override, read_named
    from app.cli.run import run_campaign

    file = override(
        read_named(campaign),
        vehicle=vehicle,
        strategy=strategy,
        start=start,
        seed=seed,
        max_flights=max_flights,
        gains=gains or [],
        settings=settings or [],
    )
    run_campaign(file, json_out=json_out, data_dir=settings_of(data_dir=data_dir).data_dir, overrule=overrule)


@app.command()
def reproduce(
    what: Annotated[Reproducible, typer.Argument(help="Experiment or table of the paper.")],
    full: Annotated[
        bool, typer.Option("--full", help="The long version, if there is one; takes several minutes.")
    ] = False,
    trace: Annotated[
        Path | None, typer.Option(metavar="FILE", help="For `controller`: another recorded run, .csv or .csv.gz.")
    ] = None,
    json_out: JsonOut = None,
) -> None:
    """Run the paper's experiments and print measured values, published values and their ratios."""
    from app.cli.reproduce import reproduce as run

    run(what, full=full, trace=trace, json_out=json_out)


@app.command("sim-drone")
def sim_drone(
    autopilot: Annotated[
        str | None,
        typer.Option(
            show_default="the first of these",
            help="Autopilot to simulate: paparazzi, paparazzi-bare, paparazzi-5.10, ardupilot, ardupilot-4.7 or px4.",
        ),
    ] = None,
    link: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            show_default="udp:127.0.0.1:4244@4245 for Paparazzi, else udp:127.0.0.1:14550",
            help="Address of the ground station and, after @, local port of the drone: "
            r"udp:HOST:PORT\[@LOCALPORT].",
        ),
    ] = None,
    vehicle: Annotated[str, typer.Option(help="Flight model: jsbsim or twin.")] = "jsbsim",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=NUMBER", help="Setting of the flight model. Repeatable.")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first flight; each later flight uses the next seed.")
    ] = 1,
    speed: Annotated[float, typer.Option(help="Speed of simulated time relative to real time.")] = 1.0,
    catch_up_s: Annotated[
        float,
        typer.Option(
            "--catch-up",
            min=0.05,
            metavar="SECONDS",
            help="Longest lag of simulated time that is caught up on a busy computer; a longer one is lost.",
        ),
    ] = 2.0,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:DURATION]@T",
            help="Fault to inject T s after the takeoff command, or @connect; docs/sim-drone.md lists the "
            "faults. Repeatable.",
        ),
    ] = None,
    system: Annotated[int | None, typer.Option(min=1, max=255, help="MAVLink system id.")] = None,
    failsafes: Annotated[
        bool,
        typer.Option(
            help="ArduPilot and PX4: enable the failsafes that a flight needs, or leave all off, as in the default "
            "parameters."
        ),
    ] = True,
    mocap: Annotated[
        str | None,
        typer.Option(
            metavar="SOURCE",
            help="Simulate motion capture of the drone: natnet:HOST?body=ID, odometry (on its own link), or "
            "mavlink:ADDRESS.",
        ),
    ] = None,
    any_network: Annotated[bool, typer.Option("--any-network", help="Allow links to other computers.")] = False,
) -> None:
    """Run a simulated MAVLink drone until stopped."""
    from app.cli.sim_drone import run_sim_drone

    run_sim_drone(
        autopilot,
        link=link,
        vehicle=vehicle,
        settings=settings or [],
        seed=seed,
        speed=speed,
        catch_up_s=catch_up_s,
        faults=fault or [],
        system=system,
        failsafes=failsafes,
        mocap=mocap,
        any_network=any_network,
    )


@app.command(name="import")
def import_log(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="MAVLink .tlog, ArduPilot .bin, PX4 .ulg, Paparazzi .data (a .log next to it is read too), or CSV.",
        ),
    ],
    campaign: Annotated[str, typer.Option(metavar="ID|NAME", help="Campaign of the flight.")],
    trial: Annotated[
        int | None, typer.Option(min=1, help="Number of the trial, if more than one waits for its record.")
    ] = None,
    takeoff: Annotated[
        int | None, typer.Option(min=1, help="Number of the takeoff, if the log contains several.")
    ] = None,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes",
            help="Answer every question with yes: accept gains that were not planned, read a record as it looks, store "
            "one that does not count as an invalid flight.",
        ),
    ] = False,
    data_dir: DataDir = None,
    json_out: JsonOut = None,
) -> None:
    """Import the log of a flight flown elsewhere; takeoff and gains are read from it."""
    from app.cli.files import import_log as run

    settings = settings_of(data_dir=data_dir)
    run(file, settings, campaign=campaign, trial=trial, takeoff=takeoff, yes=yes, json_out=json_out)


@app.command()
def analyze(
    log: GivenLog,
    gains: FlownGains = "",
    vehicle: Annotated[int | None, typer.Option(metavar="ID", help="System id, if a log has several vehicles.")] = None,
    params: ParametersOut = None,
    json_out: JsonOut = None,
) -> None:
    """Propose better altitude gains from a flight log, and print what the model predicts for them; and say how well the
    replica of the autopilot's vertical loop explains it."""
    from app.cli.log_analysis import analyze_log

    analyze_log(log, gains=gains, vehicle=vehicle, json_out=json_out, params_out=params)


@app.command()
def report(
    campaign: GivenCampaign,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", show_default="campaign-ID-report.html", help="Output file.")
    ] = None,
    kind: Annotated[
        Literal["html", "pdf"] | None,
        typer.Option("--format", show_default="from the extension of FILE, else html", help="html or pdf."),
    ] = None,
    data_dir: DataDir = None,
) -> None:
    """Write a campaign's report as one self-contained file. PDF needs Chromium."""
    from app.cli.files import report as run

    run(campaign, settings_of(data_dir=data_dir), out=out, kind=kind)


@app.command()
def bundle(
    campaign: GivenCampaign,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", show_default="campaign-ID.gainline.zip", help="Output file.")
    ] = None,
    data_dir: DataDir = None,
) -> None:
    """Export a campaign with its records, photos and logs as one file, for import into another installation."""
    from app.cli.files import bundle as run

    run(campaign, settings_of(data_dir=data_dir), out=out)


@app.command()
def unbundle(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Bundle written by `gainline bundle`.")],
    data_dir: DataDir = None,
) -> None:
    """Import a campaign from another installation, with identical numbers."""
    from app.cli.files import unbundle as run

    run(file, settings_of(data_dir=data_dir))
