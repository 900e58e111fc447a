"""Server and browser on a machine without any network: run inside a separate network namespace, by `test_offline`.

Writes what it saw as JSON to its standard output.
"""

import array
import fcntl
import json
import socket
import struct
import sys
import tempfile
from contextlib import closing
from pathlib import Path

from tests.e2e.conftest import launched, new_context, served, watch
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States

_SET_FLAGS, _UP_AND_RUNNING = 0x8914, 0x1 | 0x40


def bring_loopback_up() -> None:
    """A new network namespace has a loopback, but it is down."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = array.array("b", struct.pack("16sh14x", b"lo", _UP_AND_RUNNING))
        fcntl.ioctl(any_socket, _SET_FLAGS, request)


def is_unplugged() -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        try:
            any_socket.connect(("192.0.2.1", 80))
        except OSError:
            return True
    return False


def main(chromium: str) -> None:
    bring_loopback_up()
    wrong: list[str] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        served(Path(folder) / "data") as server,
        closing(States(server.data_dir)) as states,
        launched(chromium) as browser,
        new_context(browser, server.url) as context,
    ):
        dashboard = Dashboard(context.new_page(), server.url)
        watch(dashboard.page, server.url, wrong)
        dashboard.open_campaign(states.campaign(flights=1))
        dashboard.fly_headless(dashboard.campaign_id, 1)
        dashboard.wait_for_flight(2)
        dashboard.settled()
        alerts = dashboard.page.get_by_role("alert").all_inner_texts()
    json.dump({"unplugged": is_unplugged(), "wrong": wrong, "alerts": alerts}, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
