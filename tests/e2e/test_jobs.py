"""The page of jobs: what failed stands first, with why, what to do, and its log; it is retried."""

import json
import os
import re
import signal
from contextlib import suppress
from pathlib import Path

from playwright.sync_api import expect

from app.reproductions.registry import NICENESS
from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States


def children_of(pid: int) -> list[int]:
    """Every process below that one."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            after_name = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(after_name[1]) == pid:
            child = int(stat.parent.name)
            found += [child, *children_of(child)]
    return found


def computing(server: Server) -> int | None:
    """The process that computes a reproduction: the only one that yields to all others."""
    worker = json.loads((server.data_dir / "worker.lock").read_text())["pid"]
    for pid in children_of(worker):
        try:
            if os.getpriority(os.PRIO_PROCESS, pid) - os.getpriority(os.PRIO_PROCESS, 0) == NICENESS:
                return pid
        except ProcessLookupError:
            continue
    return None


def kill_until_given_up(dashboard: Dashboard, server: Server, job_id: int) -> None:
    def killed() -> bool:
        if (pid := computing(server)) is not None:
            with suppress(ProcessLookupError):  # one that was killed before, and collected just now
                os.kill(pid, signal.SIGKILL)
        return bool(dashboard.get(f"/jobs/{job_id}")["state"] == "failed")

    dashboard.until(killed)


def test_a_job_whose_process_is_killed_again_and_again_fails_with_its_log_and_is_retried(
    open_dashboard: Opener, empty_server: Server, states: States
) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    dashboard.open("/jobs")
    job_id = dashboard.post("/reproductions/f16/run")["id"]  # lasts until it is cancelled
    kill_until_given_up(dashboard, empty_server, job_id)
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


def test_jobs_are_filtered_by_what_became_of_them(open_dashboard: Opener, empty_server: Server) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    dashboard.post("/reproductions/controller/run")
    dashboard.until(lambda: bool(dashboard.get("/reproductions/controller")["rows"]))
    dashboard.open("/jobs")
    filters = page.get_by_role("radiogroup", name="Jobs shown")
    expect(page.get_by_role("region", name="Finished jobs").locator("tbody").first).to_be_visible()
    filters.get_by_text("Failed", exact=True).click()
    expect(page.get_by_text("No failed jobs.")).to_be_visible()
    filters.get_by_text("Finished", exact=True).click()
    [job] = dashboard.get("/jobs")["items"]
    log = page.get_by_role("button", name=f"Log of job {job['id']}")
    log.click()
    expect(page.get_by_text("reproduction stored")).to_be_visible()
