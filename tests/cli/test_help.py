"""The help of the `gainline` command shows all that it says: nothing in it is taken for markup."""

import pytest
from typer.testing import CliRunner

from app.cli.commands import app


@pytest.mark.parametrize(
    ("command", "shown"),
    [
        ("serve", "[default: (GAINLINE_HOST, else 127.0.0.1)]"),
        ("serve", "[default: (GAINLINE_PORT, else 8000)]"),
        ("serve", "[default: (GAINLINE_DATA_DIR)]"),
        ("report", "[default: (campaign-ID-report.html)]"),
        ("report", "[default: (from the extension of FILE, else html)]"),
        ("bundle", "[default: (campaign-ID.gainline.zip)]"),
        ("sim-drone", "[default: (the first of these)]"),
        ("sim-drone", "udp:HOST:PORT[@LOCALPORT]."),
        ("sim-drone", "[default: (udp:127.0.0.1:4244@4245 for Paparazzi, else udp:127.0.0.1:14550)]"),
    ],
)
def test_an_options_help_shows_its_default(command: str, shown: str) -> None:
    printed = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "400", "TERMINAL_WIDTH": "400"}).output
    assert shown in printed
