"""What a person does with a registered vehicle at the fly screen: take control, stage, hold to fly."""

import re

from playwright.sync_api import Locator, Page, Response, expect

from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.runtime.drones import TRIED, Drone

DRONE_SPEED = 2.0
"""Of the drone's time: a flight takes 17 s. The ground's time is real, so the drone is never late. A stall of
the machine is so many times longer in the drone's time: at 8, one of 0.45 s was taken for a clock that had stopped."""
HOLD_MS = 2000
"""What a hold takes, by the page's clock."""
ASK_MS = 1000
"""Interval at which the page asks for readiness, by its clock."""


def register(dashboard: Dashboard, drone: Drone) -> int:
    """The drone as a REAL vehicle of the server, connected."""
    registered = dashboard.post(
        "/vehicles",
        {
            "name": "Number 1",
            "kind": "mavlink",
            "options": {"address": drone.address},
            "safe_gains_confirmed": True,
            "statement": "Ada has seen it fly on these",
        },
    )
    assert registered["is_real"]
    vehicle_id: int = registered["id"]
    dashboard.post(f"/vehicles/{vehicle_id}/connect")
    in_state(dashboard, vehicle_id, "ready")
    return vehicle_id


def plan(states: States, vehicle_id: int) -> int:
    """A trial of gains other than the safe ones, in a rehearsed campaign of its own."""
    once = {"kind": "budget", "max_flights": 1}
    campaign_id = states.campaign("mavlink", name="Up to 3 m", vehicle_id=vehicle_id, stop=once)
    states.rehearse(campaign_id)
    return states.plan(campaign_id, TRIED)


def disconnect(dashboard: Dashboard, vehicle_id: int) -> None:
    """Whoever is in control of it."""
    vehicle = f"{dashboard.url}/api/vehicles/{vehicle_id}"
    lease = dashboard.page.request.put(f"{vehicle}/control", data={"operator": "Office", "take_over": True})
    assert lease.ok, lease.text()
    token = {"X-Gainline-Control": lease.json()["token"]}
    asked = dashboard.page.request.post(f"{vehicle}/disconnect", data={}, headers=token)
    assert asked.ok, asked.text()
    in_state(dashboard, vehicle_id, "disconnected")


def in_state(dashboard: Dashboard, vehicle_id: int, state: str) -> None:
    dashboard.until(lambda: dashboard.get(f"/vehicles/{vehicle_id}")["state"] == state)


def state_of(dashboard: Dashboard, trial_id: int) -> str:
    state: str = dashboard.get(f"/trials/{trial_id}")["state"]
    return state


def take_control(dashboard: Dashboard) -> None:
    """As Ada."""
    dashboard.page.get_by_label("Your name").fill("Ada")
    dashboard.page.get_by_role("button", name=re.compile("^Take (control|over)$")).click()


def stage(dashboard: Dashboard, gains: int) -> None:
    """Have so many gains staged, and see each one read back."""
    dashboard.button("Stage gains").click()
    expect(dashboard.page.get_by_label("read back")).to_have_count(gains)
    expect(hold_button(dashboard.page)).to_be_enabled()


def hold_button(page: Page) -> Locator:
    return page.get_by_role("button", name=re.compile("^(Hold to fly|Keep holding)"))


def stop_the_clock(dashboard: Dashboard) -> None:
    """Let the page's clock stand still on an answer about readiness asked since, whatever else the machine does.

    An answer holds for 4 s of that clock, which outruns the server: the jump leaves none from before, and of the two
    that follow, the first may have been asked earlier. The page asks anew once it has read an answer, so its clock
    goes on until it has.
    """
    page = dashboard.page
    page.clock.pause_at(float(page.evaluate("Date.now()")) / 1000 + 5)
    answered: list[Response] = []

    def is_answered() -> bool:
        page.clock.run_for(ASK_MS // 4)
        return len(answered) >= 2 and hold_button(page).is_enabled()

    def hear(response: Response) -> None:
        if response.url.endswith("/readiness"):
            answered.append(response)

    page.on("response", hear)
    dashboard.until(is_answered)
    page.remove_listener("response", hear)


def press(dashboard: Dashboard) -> None:
    """Put the finger on the button while the page's clock stands still."""
    page = dashboard.page
    stop_the_clock(dashboard)
    middle_of(page, hold_button(page))
    page.mouse.down()
    expect(hold_button(page)).to_contain_text("Keep holding")


def hold(dashboard: Dashboard, for_ms: int) -> None:
    """Press, and let the page's own clock run so far, and no further: it is one of `page.clock`."""
    page = dashboard.page
    press(dashboard)
    page.clock.run_for(for_ms)
    page.mouse.up()
    page.clock.resume()


def hold_until_it_flies(dashboard: Dashboard, trial_id: int) -> None:
    hold(dashboard, HOLD_MS + 200)
    dashboard.until(lambda: dashboard.get(f"/trials/{trial_id}")["flight"]["take_off_at"] is not None)


def see_it_fly(dashboard: Dashboard, points: int) -> None:
    """Until the live curve has more than so many."""
    dashboard.until(lambda: (live := dashboard.trace("Live curve", "live")) is not None and len(live["x"]) > points)


def abort(dashboard: Dashboard) -> None:
    """The big button, beside the vehicle's own in the bar."""
    dashboard.page.get_by_label("Next action").get_by_role("button", name=re.compile("^ABORT")).click()


def middle_of(page: Page, target: Locator) -> tuple[float, float]:
    """Where the pointer then is."""
    box = target.bounding_box()
    assert box is not None
    place = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*place)
    return place


def word(dashboard: Dashboard) -> Locator:
    return dashboard.page.get_by_role("heading", level=1)


def line_of(dashboard: Dashboard) -> Locator:
    """What every page says of the vehicle."""
    return dashboard.page.get_by_role("region", name=re.compile("^Vehicle "))
