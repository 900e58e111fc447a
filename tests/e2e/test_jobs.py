"""The page of jobs: what failed stands first, with why, what to do, and its log; it is retried."""

import os
import re
import signal
from contextlib import suppress

from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.runtime.processes import fork_server, started_by


def kill_until_given_up(dashboard: Dashboard, forks: int, job_id: int, others: set[int]) -> None:
    """Kill whatever the fork server has begun for the job: what is none of the other processes."""

    def killed() -> bool:
        for pid in set(started_by(forks)) - others:
            with suppress(ProcessLookupError):  # one that was killed before, and collected just now
                os.kill(pid, signal.SIGKILL)
        return bool(dashboard.get(f"/jobs/{job_id}")["state"] == "failed")

    dashboard.until(killed)


def test_a_job_is_watched_fails_when_its_process_is_killed_again_and_again_is_retried_and_cancelled(
    open_dashboard: Opener, empty_server: Server, states: States
) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    dashboard.open("/jobs")
    expect(page.get_by_text("No jobs yet.")).to_be_visible()
    forks = fork_server(empty_server.worker_pid())
    others = set(started_by(forks))
    job_id = dashboard.post("/reproductions/variability/run")["id"]
    card = page.locator("tbody").filter(has_text=f"Job {job_id}")
    expect(card.get_by_role("link", name="Fig. 12: takeoffs repeated over a battery")).to_be_visible()
    expect(card.get_by_text(re.compile(r"^[1-9]\d?\s% · .*battery \d+ of 240 flown"))).to_be_visible()
    kill_until_given_up(dashboard, forks, job_id, others)
    states.reproduce("controller")
    groups = page.get_by_role("main").get_by_role("region", name=re.compile("jobs$"))
    expect(groups.nth(1)).to_be_visible()
    first = groups.first.locator("tbody").first
    expect(first).to_contain_text(f"Job {job_id}")
    expect(first.get_by_text("Failed", exact=True)).to_be_visible()
    job = dashboard.get(f"/jobs/{job_id}")
    assert (job["attempts"], job["problem"]["title"]) == (3, "The worker stopped 3 times during this job.")
    expect(first).to_contain_text(job["problem"]["title"])
    expect(first).to_contain_text(job["problem"]["hint"])
    first.get_by_role("button", name=f"Log of job {job_id}").click()
    lines = first.get_by_role("listitem")
    expect(lines.first).to_contain_text("job started")
    expect(lines.filter(has_text="the computing process died")).to_have_count(3)
    told = dashboard.get(f"/jobs/{job_id}/log")
    expect(lines).to_have_count(told["total"])
    assert {line["details"]["exit_code"] for line in told["lines"] if "exit_code" in line["details"]} == {"-9"}
    first.get_by_role("button", name=f"Retry job {job_id}").click()
    active = page.get_by_role("region", name="Active jobs").locator("tbody").first
    expect(active).to_contain_text(f"Job {job_id}")
    expect(active.get_by_role("progressbar")).to_be_visible()
    active.get_by_role("button", name=f"Cancel job {job_id}").click()
    over = page.get_by_role("region", name="Finished jobs")
    expect(over.get_by_text("Cancelled", exact=True)).to_be_visible()
    filters = page.get_by_role("radiogroup", name="Jobs shown")
    for shown in ("Active", "Failed"):
        filters.get_by_text(shown, exact=True).click()
        expect(page.get_by_text(f"No {shown.lower()} jobs.")).to_be_visible()
    filters.get_by_text("Finished", exact=True).click()
    expect(card.get_by_text("Cancelled", exact=True)).to_be_visible()
