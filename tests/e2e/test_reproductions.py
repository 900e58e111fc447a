"""The pages of reproductions and of jobs: run, watched, read, cancelled, begun again."""

import re

from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States

FIG6 = "Fig. 6: the replica of the controller"


def test_a_reproduction_is_run_and_read_where_it_stands(open_dashboard: Opener, empty_server: Server) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    dashboard.open("/")
    dashboard.button("More pages").click()
    page.get_by_role("navigation", name="Pages").get_by_role("link", name="Reproductions").click()
    card = page.get_by_role("article", name=FIG6)
    expect(card.get_by_text("Not run yet.")).to_be_visible()
    dashboard.button(f"Run: {FIG6}").click()
    expect(card.get_by_role("progressbar")).to_be_visible()
    expect(dashboard.button(f"Cancel: {FIG6}")).to_be_visible()
    table = card.get_by_role("table").first
    expect(table).to_be_visible()
    found = dashboard.get("/reproductions/controller")
    shown = [row.inner_text().split() for row in table.locator("tbody tr").all()][1:]
    assert [cells[0] for cells in shown] == [row["label"] for row in found["rows"]]
    assert {cells[-1] for cells in shown} == {"0"}
    for figure in found["figures"]:
        told = dashboard.get(f"/reproductions/controller/figures/{figure['name']}")
        plot = page.get_by_role("group", name=re.compile(rf"^{re.escape(told['title'])}")).locator(".js-plotly-plot")
        expect(plot).to_be_visible()
        drawn = plot.evaluate(
            "gd => gd.data.map(trace => ({meta: trace.meta, x: Array.from(trace.x), y: Array.from(trace.y)}))"
        )
        assert drawn == [{key: trace[key] for key in ("meta", "x", "y")} for trace in told["figure"]["data"]]
    expect(dashboard.button(f"Run: {FIG6}")).to_be_visible()
    [job] = dashboard.get("/jobs")["items"]
    dashboard.open("/jobs")
    page.get_by_role("button", name=f"Log of job {job['id']}").click()
    expect(page.get_by_text("reproduction stored")).to_be_visible()


def test_long_lists_of_jobs_come_in_pages(open_dashboard: Opener, empty_server: Server, states: States) -> None:
    dashboard: Dashboard = open_dashboard(empty_server.url)
    states.propose_again(states.campaign(), 22)
    total = dashboard.get("/jobs")["total"]
    assert total > 20
    dashboard.open("/jobs")
    jobs = dashboard.page.locator("tbody tr[data-state]")
    expect(jobs).to_have_count(20)
    dashboard.button(f"Show more (20 of {total})").click()
    expect(jobs).to_have_count(total)
    newest = dashboard.get("/jobs")["items"][0]["id"]
    expect(jobs.first).to_contain_text(f"Job {newest}")
