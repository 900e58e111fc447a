"""Server and browser on a machine without any network: run inside a separate network namespace, by `test_offline`.

Writes what it saw as JSON to its standard output: per page its address, its heading, and what it asked elsewhere.
"""

import array
import fcntl
import json
import re
import socket
import struct
import sys
import tempfile
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from playwright.sync_api import Page, expect, sync_playwright

from tests.e2e.conftest import FLAGS, PATIENCE_MS, served
from tests.e2e.dashboard import TABLET, Dashboard, Json

ROUTES: Final = Path(__file__).parents[2] / "frontend" / "src" / "app.tsx"
_SET_FLAGS, _UP_AND_RUNNING = 0x8914, 0x1 | 0x40


def pages() -> list[str]:
    """The addresses of all pages, with their parameters, as the dashboard's own routes have them."""
    return ["", *(path for path in re.findall(r'<Route path="([^"]+)"', ROUTES.read_text()) if path != "*")]


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


def something_of_everything(dashboard: Dashboard) -> dict[str, str]:
    """A flown campaign and a registered vehicle, as values of the routes' parameters."""
    campaign = dashboard.post("/campaigns", {"name": "Offline", "vehicle": {"kind": "twin"}, "definition": {}})
    proposal = f"/campaigns/{campaign['id']}/proposal"
    dashboard.until(lambda: dashboard.get(proposal)["state"] == "ready", within_s=180)
    gains = {"kp": 283, "ki": 13, "kd": 82}
    trial = dashboard.post(f"/campaigns/{campaign['id']}/trials", {"gains": gains, "fly": {"speed": None}})
    dashboard.until(lambda: dashboard.get(f"/trials/{trial['id']}")["state"] == "valid", within_s=120)
    options = {"address": "udp:127.0.0.1:14991@14990", "simulated": True}
    vehicle = dashboard.post("/vehicles", {"name": "Bee", "kind": "mavlink", "options": options})
    return {
        ":campaignId": str(campaign["id"]),
        ":trialId": str(trial["id"]),
        ":vehicleId": str(vehicle["id"]),
        ":checkId?": "",
    }


def visit(dashboard: Dashboard, path: str) -> Json:
    asked: list[str] = []
    page = dashboard.page

    def note(url: str) -> None:
        parts = urlsplit(url)
        if parts.scheme in {"http", "https", "ws", "wss"} and parts.netloc != urlsplit(dashboard.url).netloc:
            asked.append(url)

    page.on("request", lambda request: note(request.url))
    page.on("websocket", lambda opened: note(opened.url))
    dashboard.open(path)
    expect(page.locator("[aria-busy=true]")).to_have_count(0)
    heading = page.get_by_role("heading", level=1)
    expect(heading).to_be_visible()
    for chart in page.locator(".js-plotly-plot").all():
        expect(chart).to_have_attribute("data-drawn", "true")
    return {"path": path, "heading": heading.inner_text(), "elsewhere": asked, "alerts": alerts(page)}


def alerts(page: Page) -> list[str]:
    return page.get_by_role("alert").all_inner_texts()


def main(chromium: str) -> None:
    bring_loopback_up()
    seen: list[Json] = []
    expect.set_options(timeout=PATIENCE_MS)
    with (
        tempfile.TemporaryDirectory() as folder,
        served(Path(folder) / "data") as server,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        context = browser.new_context(base_url=server.url, viewport=TABLET)
        dashboard = Dashboard(context.new_page(), server.url)
        values = something_of_everything(dashboard)
        for route in pages():
            dashboard.page = context.new_page()
            seen.append(visit(dashboard, "/" + "/".join(values.get(part, part) for part in route.split("/"))))
            dashboard.page.close()
        browser.close()
    json.dump({"unplugged": is_unplugged(), "pages": seen}, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
