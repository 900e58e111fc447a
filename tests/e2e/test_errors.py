"""Every error that the API can return, provoked for real, and read on the screen: what happened and what to do."""

import json
import os
import re
import signal
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import FilePayload, Response, Route, expect

import app.common.errors
from app.common.errors import (
    BusyError,
    ConflictError,
    ForeignRequestError,
    GainlineError,
    GainsError,
    InputError,
    KeyReusedError,
    MediaTypeError,
    NotAllowedError,
    NotFoundError,
    StorageError,
    TooLargeError,
    TrajectoryError,
    UnavailableError,
    UnconfirmedError,
)
from app.live.link import LinkDownError
from app.web import errors as over_http
from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, Json, open_details
from tests.e2e.states import States
from tests.logs.recorded import recorded
from tests.waiting import Waits

AT_START: Final = {app.common.errors.SchemaError, app.common.errors.AlreadyRunningError, app.common.errors.AddressError}
"""These end the program before it answers anybody."""
FRAMEWORK: Final = ("400", "404", "405", "invalid", "unexpected")
"""Responses that do not come from the application's own code."""
OWN_WORDS: Final[dict[object, str]] = {
    LinkDownError: "It is sent again until the worker confirms it. If a vehicle is in the air, use its own remote"
}
"""What to do, where the page does not repeat the API's hint: its banner says how a worker is started again."""
OF_FORMS: Final[dict[object, str]] = {
    InputError: "Correct the marked field: bounds of kp.",
    "invalid": "Correct the marked field: Maximum flights.",
}
"""What a form says instead of the API's sentence and hint, because every reason stands at its field."""
Undo = Callable[[], None]
Provoke = Callable[[Dashboard, Server, States], Undo | None]
"""What it returns is called once the page has been read: until then the error has to last."""
PROVOKED: Final[dict[type[GainlineError] | str, Provoke]] = {}


def provokes(kind: type[GainlineError] | str) -> Callable[[Provoke], Provoke]:
    def keep(provoke: Provoke) -> Provoke:
        PROVOKED[kind] = provoke
        return provoke

    return keep


def instead(
    dashboard: Dashboard,
    act: str,
    *,
    path: str | None = None,
    url: str | None = None,
    method: str | None = None,
    body: str | bytes | None = None,
    headers: dict[str, str] | None = None,
) -> None:
    """Have that act of the page sent otherwise than the page would; the server's own answer comes back to it."""

    def send(route: Route) -> None:
        request = route.request
        if request.method == "GET":
            route.fallback()
            return
        route.fulfill(
            response=route.fetch(
                url=None if path is None else f"{url or dashboard.url}/api{path}",
                method=method,
                post_data=body,
                headers={**request.headers, **(headers or {})},
            )
        )

    dashboard.page.route(f"**/api{act}", send)


def create_instead(
    dashboard: Dashboard,
    *,
    path: str | None = None,
    url: str | None = None,
    method: str | None = None,
    body: str | bytes | None = None,
    headers: dict[str, str] | None = None,
) -> None:
    """Press "Create campaign" on its page, with another request behind it."""
    instead(dashboard, "/campaigns", path=path, url=url, method=method, body=body, headers=headers)
    create(dashboard)


def create(dashboard: Dashboard) -> None:
    if not dashboard.page.url.endswith("/new"):
        dashboard.open("/new")
    dashboard.button("Create campaign").click()


@contextmanager
def stopped_worker(server: Server) -> Iterator[None]:
    """Neither working nor answering, and not just holding the database."""
    worker = server.worker_pid()
    with closing(
        sqlite3.connect(server.data_dir / "gainline.sqlite3", timeout=Waits.at_most_s, isolation_level=None)
    ) as file:
        file.execute("BEGIN IMMEDIATE")
        os.kill(worker, signal.SIGSTOP)
        file.execute("ROLLBACK")
    try:
        yield
    finally:
        os.kill(worker, signal.SIGCONT)


def hand_in(dashboard: Dashboard, states: States, name: str, content: bytes | Path) -> None:
    if "/campaigns/" not in dashboard.page.url:
        dashboard.open_campaign(states.campaign("import"))
    with dashboard.page.expect_file_chooser() as chooser:
        dashboard.button("Upload flight record").click()
    if isinstance(content, Path):
        chooser.value.set_files(content)
    else:
        chooser.value.set_files(FilePayload(name=name, mimeType="application/octet-stream", buffer=content))


# ---- one of each kind


@provokes(NotAllowedError)
def _a_real_vehicle_ordered_off_at_once(dashboard: Dashboard, _server: Server, states: States) -> None:
    vehicle = states.vehicle(
        "Ordered off",
        options={"address": "udp:127.0.0.1:14995@14994"},
        safe_gains_confirmed=True,
        statement="Ada has seen it fly on these",
    )
    campaign = states.campaign("mavlink", name="Up to 3 m", vehicle_id=vehicle)
    order = {"gains": {"kp": 283, "ki": 13, "kd": 82}, "fly": {"speed": 1}}
    create_instead(dashboard, path=f"/campaigns/{campaign}/trials", body=json.dumps(order))


@provokes(NotFoundError)
def _a_campaign_that_never_was(dashboard: Dashboard, _server: Server, _states: States) -> None:
    dashboard.open("/campaigns/999999")


@provokes(ConflictError)
def _a_campaign_finished_before_its_first_flight(dashboard: Dashboard, _server: Server, _states: States) -> None:
    made = dashboard.post("/campaigns", {"name": "New", "vehicle": {"kind": "twin"}, "definition": {}})
    create_instead(dashboard, path=f"/campaigns/{made['id']}/finish", body="{}")


@provokes(TooLargeError)
def _a_log_of_a_whole_summer(dashboard: Dashboard, server: Server, states: States) -> None:
    log = server.data_dir.parent / "summer.tlog"
    log.write_bytes(bytes(49 * 2**20))
    hand_in(dashboard, states, log.name, log)


@provokes(MediaTypeError)
def _a_form_in_place_of_json(dashboard: Dashboard, _server: Server, _states: States) -> None:
    create_instead(dashboard, headers={"content-type": "application/x-www-form-urlencoded"})


@provokes(KeyReusedError)
def _the_key_of_another_act(dashboard: Dashboard, _server: Server, _states: States) -> None:
    key = {"Idempotency-Key": "written-once"}
    body = {"name": "First", "vehicle": {"kind": "twin"}, "definition": {}}
    assert dashboard.page.request.post(f"{dashboard.url}/api/campaigns", data=body, headers=key).ok
    create_instead(dashboard, headers={"idempotency-key": "written-once"})


@provokes(GainsError)
def _gains_under_which_the_integrator_wraps(dashboard: Dashboard, _server: Server, states: States) -> None:
    dashboard.open_campaign(states.campaign())
    body = json.dumps({"gains": {"kp": 283, "ki": 1356, "kd": 82}})
    instead(dashboard, "/campaigns/*/trials", body=body)
    dashboard.fly()


@provokes(TrajectoryError)
def _a_record_of_one_sample(dashboard: Dashboard, _server: Server, states: States) -> None:
    hand_in(dashboard, states, "short.csv", b"time_s,altitude_m\n0,0\n")


@provokes(UnconfirmedError)
def _a_log_flown_with_other_gains(dashboard: Dashboard, _server: Server, states: States) -> None:
    hand_in(dashboard, states, "tuned.tlog", recorded("paparazzi_1624_1356_195.tlog"))


@provokes(InputError)
def _bounds_the_wrong_way_round(dashboard: Dashboard, _server: Server, _states: States) -> None:
    dashboard.open("/new")
    dashboard.page.get_by_role("button", name=re.compile("^Advanced")).click()
    dashboard.page.get_by_label("kp minimum").fill("3000")
    dashboard.page.get_by_label("kp maximum").fill("2000")
    dashboard.button("Create campaign").click()


@provokes(LinkDownError)
def _an_abort_while_the_worker_is_stopped(dashboard: Dashboard, server: Server, states: States) -> Undo:
    campaign_id = states.campaign()
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("1×")
    dashboard.fly()
    abort = dashboard.page.get_by_role("button", name=re.compile("^ABORT")).first
    expect(abort).to_be_visible()
    with ExitStack() as stack:
        [trial] = dashboard.trials(campaign_id)
        stack.callback(lambda: dashboard.post(f"/trials/{trial['id']}/abort"))
        stack.enter_context(stopped_worker(server))
        abort.click()
        expect(dashboard.page.get_by_role("alert")).to_contain_text("remote control")
        return stack.pop_all().close


def _answer(error: GainlineError) -> Provoke:
    """The program's own answer to that error, which is slow to provoke, and is provoked over HTTP."""

    def provoke(dashboard: Dashboard, _server: Server, _states: States) -> None:
        made = over_http.problem_response(error)

        def answer(route: Route) -> None:
            if route.request.method == "GET":
                route.fallback()
            else:
                route.fulfill(status=made.status_code, content_type=over_http.MEDIA_TYPE, body=bytes(made.body))

        dashboard.page.route("**/api/campaigns", answer)
        create(dashboard)

    return provoke


for _error in (
    GainlineError("The order cannot be read.", hint="Run the reproduction again."),
    BusyError("Bee is still being connected.", hint="Wait until that is over."),
    UnavailableError("No browser was found that prints a PDF.", hint="Install Chromium."),
    StorageError("The database is locked by another program.", hint="Close that program, then try again."),
):
    PROVOKED[type(_error)] = _answer(_error)


@provokes("400")
def _a_body_that_is_no_text(dashboard: Dashboard, _server: Server, _states: States) -> None:
    create_instead(dashboard, body=b"\xff\xfe{")


@provokes("404")
def _a_path_that_is_not_there(dashboard: Dashboard, _server: Server, _states: States) -> None:
    create_instead(dashboard, path="/campaign")


@provokes("405")
def _a_method_that_is_not_known(dashboard: Dashboard, _server: Server, _states: States) -> None:
    create_instead(dashboard, method="DELETE")


@provokes("invalid")
def _a_budget_below_nothing(dashboard: Dashboard, _server: Server, _states: States) -> None:
    dashboard.open("/new")
    dashboard.page.get_by_role("button", name=re.compile("^Advanced")).click()
    dashboard.page.get_by_label("Maximum flights").fill("-3")
    dashboard.button("Create campaign").click()


@provokes(ForeignRequestError)
def _a_page_of_another_site(dashboard: Dashboard, _server: Server, _states: States) -> None:
    create_instead(dashboard, headers={"origin": "http://elsewhere.example"})


@provokes("unexpected")
def _a_trial_that_somebody_broke_in_the_database(dashboard: Dashboard, server: Server, states: States) -> Undo:
    campaign_id = states.campaign("import")
    trial = states.plan(campaign_id, {"kp": 283, "ki": 13, "kd": 82})
    with closing(sqlite3.connect(server.data_dir / "gainline.sqlite3", timeout=Waits.at_most_s)) as file:
        file.execute("UPDATE trial SET gains = '[1]' WHERE id = ?", (trial,))
        file.commit()
    dashboard.open(f"/campaigns/{campaign_id}/flights/{trial}")
    return states.clear


# ---- what must be on the screen

TITLES: Final = {
    "400": "Bad Request", "404": "Not Found", "405": "Method Not Allowed", "invalid": "Unusable input",
    "unexpected": "Internal Server Error",
}  # fmt: skip


def answered_kinds() -> set[type[GainlineError] | str]:
    """What the API can answer, as the program itself says: a class of errors that is new needs a story here."""
    declared = vars(app.common.errors).values()
    classes = {one for one in declared if isinstance(one, type) and issubclass(one, GainlineError)}
    return (classes - AT_START) | set(over_http._KINDS) | set(map(str, over_http._HTTP)) | set(FRAMEWORK)


def _name(kind: object) -> str:
    return kind.__name__ if isinstance(kind, type) else str(kind)


def test_every_kind_of_error_has_a_story_that_provokes_it() -> None:
    assert set(map(_name, PROVOKED)) == set(map(_name, answered_kinds()))


ON_A_PAGE_OF_THEIR_OWN: Final[set[type[GainlineError] | str]] = {
    InputError,
    "invalid",
    NotFoundError,
    GainsError,
    LinkDownError,
    "unexpected",
}
OF_A_FILE: Final[set[type[GainlineError] | str]] = {TooLargeError, TrajectoryError, UnconfirmedError}
PAGES: Final[dict[str, set[type[GainlineError] | str]]] = {_name(kind): {kind} for kind in ON_A_PAGE_OF_THEIR_OWN} | {
    "a file": OF_A_FILE,
    "a request": PROVOKED.keys() - ON_A_PAGE_OF_THEIR_OWN - OF_A_FILE,
}
"""Errors that are read on one page, one after another."""


@pytest.mark.parametrize("of", sorted(PAGES))
def test_an_error_states_what_happened_and_what_to_do(
    dashboard: Dashboard, shared_server: Server, states: States, of: str
) -> None:
    told: list[Json] = []

    def note(answer: Response) -> None:
        if answer.headers.get("content-type", "").startswith(over_http.MEDIA_TYPE):
            told.append(answer.json())

    dashboard.page.on("response", note)
    for kind in sorted(PAGES[of], key=_name):
        dashboard.page.unroute_all()
        told.clear()
        undo = PROVOKED[kind](dashboard, shared_server, states)
        try:
            title = TITLES[kind] if isinstance(kind, str) else over_http._KINDS[kind][1]
            _is_told(dashboard, told, title, kind)
        finally:
            if undo is not None:
                undo()
    dashboard.page.remove_listener("response", note)


def _is_told(dashboard: Dashboard, told: list[Json], title: str, kind: type[GainlineError] | str) -> None:
    """One of the refusals of that title stands on the page, with what to do and where; code without its backticks."""
    of_form = OF_FORMS.get(kind)
    expect(dashboard.page.get_by_role("alert").first).to_be_visible()

    def shown() -> list[Json]:
        """The page shows one of several failed reads."""
        open_details(dashboard.page)
        text = dashboard.page.locator("body").inner_text()
        return [one for one in told if one["title"] == title and (of_form or one["detail"]) in text]

    dashboard.until(lambda: shown() != [])
    problem = shown()[-1]
    assert problem["hint"]
    if problem["script_hint"]:
        expect(dashboard.page.locator("body")).not_to_contain_text(problem["script_hint"], use_inner_text=True)
    for text in (of_form or OWN_WORDS.get(kind) or problem["hint"], *(one["reason"] for one in problem["problems"])):
        shown_text = text.replace("`", "")
        expect(dashboard.page.locator("body")).to_contain_text(shown_text, use_inner_text=True, ignore_case=True)


def test_an_unreachable_server_is_reported_with_the_fate_of_the_request(
    open_dashboard: Opener, shared_server: Server
) -> None:
    dashboard = open_dashboard(shared_server.url, alone=True)
    dashboard.open("/new")
    create = dashboard.button("Create campaign")
    expect(create).to_be_visible()
    dashboard.page.context.set_offline(True)
    create.click()
    alert = dashboard.page.get_by_role("alert")
    expect(alert).to_contain_text("The server is not responding.")
    expect(alert).to_contain_text("may or may not have been received")
    expect(alert).to_contain_text("updates automatically")
    dashboard.page.context.set_offline(False)
    expect(dashboard.page.get_by_text("Live", exact=True)).to_be_visible()
