"""Options of the `gainline` command that are long or shared, and the files that they do not overwrite."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from app.common.settings import Settings


def _begins_otherwise(target: Path | None, *beginnings: bytes) -> bool:
    """Whether a file exists that is not empty and begins otherwise, such as a log that was to be read."""
    if target is None or not target.is_file():
        return False
    with target.open("rb") as stream:
        head = stream.read(max(map(len, beginnings)))
    return bool(head) and not head.startswith(beginnings)


def _spare_recording(target: Path | None) -> Path | None:
    """Refuse to write the result over a file that is no JSON."""
    if _begins_otherwise(target, b"{"):
        raise typer.BadParameter(
            f"{target} exists and is not a JSON file, so it is not overwritten. Name another file, or - to print the "
            "result."
        )
    return target


def spare_other_parameters(target: Path | None) -> Path | None:
    """Refuse to write gains over a file that does not begin as one of them does."""
    if _begins_otherwise(target, b"# Gainline", b"<!-- Gainline", b"PSC_"):
        raise typer.BadParameter(
            f"{target} exists and was not written by this command, so it is not overwritten. Name another file."
        )
    return target


def settings_of(**given: str | int | Path | None) -> "Settings":
    """The environment's settings with what was given on the command line in place of them."""
    from app.common.settings import read_settings  # noqa: PLC0415 - help needs none

    return read_settings({name: value for name, value in given.items() if value is not None})


JsonOut = Annotated[
    Path | None,
    typer.Option("--json", metavar="OUT", help="Write the result as JSON; - prints it.", callback=_spare_recording),
]
ParametersOut = Annotated[
    Path | None,
    typer.Option(
        "--params",
        metavar="FILE",
        help="Write the proposed gains: a .param file for ArduCopter, a .params file for PX4, a section of an airframe "
        "file for Paparazzi.",
        callback=spare_other_parameters,
    ),
]
FlownGains = Annotated[
    str, typer.Option("--gains", metavar="KP,KI,KD", help="Gains flown, for the replica, if no log contains them.")
]
GivenLog = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        help="ArduCopter's .bin log, PX4's .ulg log, a .tlog of altitude steps under either, or Paparazzi's .data "
        "(a .log next to it is read too) or .tlog of takeoffs; or a trace of the vertical loop, .csv or .csv.gz.",
    ),
]
DataDir = Annotated[Path | None, typer.Option(show_default="GAINLINE_DATA_DIR", help="Folder of the database.")]
CampaignSource = Annotated[
    str,
    typer.Argument(
        metavar="PRESET|FILE.yaml",
        help="A preset, such as ardrone-takeoff or paper-ardrone-takeoff, or a campaign file.",
    ),
]
GivenCampaign = Annotated[str, typer.Argument(metavar="ID|NAME", help="The campaign.")]
StartGains = Annotated[
    str | None, typer.Option(metavar="default|simplex|KP,KI,KD", help="Source of the first flight's gains.")
]
GivenSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help=(
            "A setting of the vehicle (scatter=0, wind_m_s=3), the strategy (scaled=false) or the stop rule "
            "(improvement=0.02). Repeatable."
        ),
    ),
]
GivenGains = Annotated[
    list[str] | None,
    typer.Option(
        "--gains",
        metavar="NAME=NUMBER,…",
        help="A gain set to fly with the `manual` strategy. Repeatable; the sets are flown in this order.",
    ),
]
Overrule = Annotated[
    str, typer.Option(metavar="REASON", help="Reason to fly gains that the gate refuses (simulations only).")
]
Reproducible = Literal["f16", "table1", "table2", "controller", "variability", "all"]
"""Reproductions of `gainline reproduce`."""
