"""Lost connections: the page shows them, never shows old values as current, and recovers without a click."""

import fcntl
import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Locator, Request, Route, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.e2e.wifi import InterruptibleProxy

pytestmark = pytest.mark.real_time("a page notices a lost connection after a time of its own", about_s=10)

CHARTS_FETCHED = "performance.getEntriesByType('resource').some(one => one.name.includes('plotly'))"


@contextmanager
def stopped(pid: int) -> Iterator[None]:
    """The process neither works nor answers, and its connections stay open, like those of a lost Wi-Fi."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@contextmanager
def killed_worker(server: Server) -> Iterator[None]:
    """The next one, which would be there in two seconds, waits for the lock that the killed one has left."""
    with (server.data_dir / "worker.lock").open() as lock:
        os.kill(server.worker_pid(), signal.SIGKILL)
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def is_live(dashboard: Dashboard) -> None:
    expect(dashboard.page.get_by_text("Live", exact=True)).to_be_visible()
    expect(dashboard.page.locator("main[data-stale]")).to_have_count(0)


def is_away(dashboard: Dashboard) -> None:
    """A message, with the time up to which the page is right, and the page without its colours."""
    expect(dashboard.page.get_by_text("Server not responding", exact=True)).to_be_visible()
    notice = dashboard.page.get_by_role("status").filter(has_text="The server is not responding.")
    expect(notice.locator("time")).to_be_visible()
    expect(dashboard.page.locator("main[data-stale]")).to_be_visible()


def new_campaign(dashboard: Dashboard, name: str) -> int:
    made: int = dashboard.post("/campaigns", {"name": name, "vehicle": {"kind": "twin"}, "definition": {}})["id"]
    return made


def rename(dashboard: Dashboard, campaign_id: int, name: str) -> None:
    version = dashboard.get(f"/campaigns/{campaign_id}")["version"]
    answer = dashboard.page.request.patch(
        f"{dashboard.url}/api/campaigns/{campaign_id}", data={"name": name, "version": version}
    )
    assert answer.ok, answer.text()


def heading(dashboard: Dashboard, name: str) -> Locator:
    return dashboard.page.get_by_role("heading", name=name, exact=True)


def test_two_tabs_show_the_same_truth_over_one_stream_each(open_dashboard: Opener, shared_server: Server) -> None:
    one, other = open_dashboard(shared_server.url), open_dashboard(shared_server.url)
    streams: list[str] = []

    def note(request: Request) -> None:
        if "/api/events" in request.url:
            streams.append(request.url)

    one.page.on("request", note)
    campaign_id = new_campaign(one, "Seen twice")
    one.open(f"/campaigns/{campaign_id}")
    other.open(f"/campaigns/{campaign_id}")
    one.button("Rename campaign").click()
    one.page.get_by_label("Campaign name").fill("Seen by both")
    one.button("Rename").click()
    expect(heading(other, "Seen by both")).to_be_visible()
    one.page.get_by_role("navigation").get_by_role("link", name="Vehicles").click()
    expect(heading(one, "Vehicles")).to_be_visible()
    one.page.go_back()
    expect(heading(one, "Seen by both")).to_be_visible()
    assert len(streams) == 1
    one.page.remove_listener("request", note)
    other.page.reload()
    expect(heading(other, "Seen by both")).to_be_visible()


def test_what_changed_before_the_stream_was_there_is_shown(dashboard: Dashboard, shared_server: Server) -> None:
    page, late, may_go = dashboard.page, list[Route](), list[bool]()

    def hold(route: Route) -> None:
        if may_go:
            route.continue_()
        else:
            late.append(route)

    campaign_id = new_campaign(dashboard, "Before the stream")
    page.route("**/api/events*", hold)
    page.goto(f"{shared_server.url}/campaigns/{campaign_id}")
    expect(heading(dashboard, "Before the stream")).to_be_visible()
    rename(dashboard, campaign_id, "Renamed meanwhile")
    dashboard.until(lambda: bool(late))
    may_go.append(True)
    for route in late:
        route.continue_()
    expect(heading(dashboard, "Renamed meanwhile")).to_be_visible()


def test_a_restarted_server_is_shown_and_its_changes_arrive_automatically(
    open_dashboard: Opener, own_server: Server
) -> None:
    """Pages open anyway, because they were fetched before the server was lost."""
    dashboard, other = open_dashboard(own_server.url), open_dashboard(own_server.url)
    campaign_id = dashboard.create("twin", name="Before")
    dashboard.open_campaign(campaign_id)
    with other.page.expect_response(re.compile(r"/assets/pages-.*\.js")):
        other.open("/")
    other.until(lambda: bool(other.page.evaluate(CHARTS_FETCHED)))
    own_server.stop()
    is_away(dashboard)
    expect(dashboard.page.get_by_role("banner").get_by_text("The server is not responding.")).to_be_visible()
    expect(heading(dashboard, "Before")).to_be_visible()
    other.button("More pages").click()
    other.page.get_by_role("navigation").get_by_role("link", name="Jobs").click()
    expect(heading(other, "Jobs")).to_be_visible()
    expect(other.page.get_by_role("alert")).to_contain_text("The server is not responding.")
    own_server.start()
    is_live(dashboard)
    rename(dashboard, campaign_id, "After")
    expect(heading(dashboard, "After")).to_be_visible()
    is_live(other)
    expect(other.page.get_by_role("alert")).to_have_count(0)
    dashboard.fly_headless(campaign_id, 1)
    expect(dashboard.panel("Flight 1")).to_be_visible()


def test_a_killed_worker_is_shown_until_it_is_back(dashboard: Dashboard, shared_server: Server) -> None:
    dashboard.open("/")
    with killed_worker(shared_server):
        expect(dashboard.page.get_by_text("The worker is not responding.")).to_be_visible()
        expect(dashboard.page.get_by_text("Nothing can be flown or computed until it is back.")).to_be_visible()
    is_live(dashboard)
    expect(dashboard.page.get_by_text("The worker is not responding.")).to_have_count(0)


def bar_of_a_flight(dashboard: Dashboard, campaign_id: int) -> Locator:
    """The bar of a flight in real time that has just begun."""
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("1×")
    dashboard.fly()
    return dashboard.page.get_by_role("region", name=re.compile("^Flight in progress: "))


def test_without_a_worker_a_flight_in_the_air_is_not_called_paused(
    dashboard: Dashboard, shared_server: Server, states: States
) -> None:
    expect(bar_of_a_flight(dashboard, states.campaign())).to_be_visible()
    with killed_worker(shared_server):
        notice = dashboard.page.get_by_role("status").filter(has_text="The worker is not responding.")
        expect(notice).to_contain_text("If the worker has stopped, the simulated flight is lost.")
    is_live(dashboard)


def test_after_a_lost_wifi_the_page_catches_up(open_dashboard: Opener, shared_server: Server) -> None:
    ashore = open_dashboard(shared_server.url)
    with InterruptibleProxy(shared_server.url) as wifi:
        dashboard = open_dashboard(wifi.url)
        campaign_id = new_campaign(ashore, "At the field")
        dashboard.open(f"/campaigns/{campaign_id}")
        with wifi.lost():
            is_away(dashboard)
            rename(ashore, campaign_id, "Renamed ashore")
        is_live(dashboard)
        expect(heading(dashboard, "Renamed ashore")).to_be_visible()


def test_a_page_that_slept_wakes_up_to_date(open_dashboard: Opener, shared_server: Server) -> None:
    dashboard = open_dashboard(shared_server.url, alone=True)
    campaign_id = new_campaign(dashboard, "In the evening")
    dashboard.open(f"/campaigns/{campaign_id}")
    session = dashboard.page.context.new_cdp_session(dashboard.page)
    session.send("Page.setWebLifecycleState", {"state": "frozen"})
    rename(dashboard, campaign_id, "In the morning")
    session.send("Page.setWebLifecycleState", {"state": "active"})
    expect(heading(dashboard, "In the morning")).to_be_visible()
    is_live(dashboard)


def test_a_line_that_only_looks_open_is_given_up_and_a_flight_on_it_is_not_shown_as_current(
    dashboard: Dashboard, shared_server: Server, states: States
) -> None:
    campaign_id = states.campaign()
    bar = bar_of_a_flight(dashboard, campaign_id)
    expect(bar).to_contain_text(re.compile(r"\d\.\d\d m"))
    expect(bar).not_to_contain_text("last known")
    with stopped(shared_server.pid):
        expect(bar).to_contain_text("last known")
        is_away(dashboard)
    is_live(dashboard)
    expect(bar.get_by_text("last known")).to_have_count(0)
    dashboard.post(f"/trials/{dashboard.trials(campaign_id)[0]['id']}/abort")


def test_a_page_that_failed_to_load_says_so_and_loads_on_retry(open_dashboard: Opener, shared_server: Server) -> None:
    dashboard = open_dashboard(shared_server.url, alone=True)
    dashboard.page.route("**/assets/pages-*.js", lambda route: route.abort())
    dashboard.open("/vehicles")
    expect(dashboard.page.get_by_role("alert")).to_contain_text("This page could not be loaded.")
    expect(dashboard.page.get_by_role("alert")).to_contain_text("Try again")
    dashboard.page.unroute("**/assets/pages-*.js")
    dashboard.button("Try again").click()
    expect(heading(dashboard, "Vehicles")).to_be_visible()
