"""Vehicles that are registered one by one: a simulated drone on loopback UDP, from its form to its ledger."""

import json
import os
import re
import signal
from typing import Final

import pytest
from playwright.sync_api import Locator, expect

from tests.e2e.conftest import Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.flying_by_hand import DRONE_SPEED
from tests.e2e.states import States
from tests.runtime.drones import SAFE, TRIED, Drone

SAFE_IN_BRACKETS: Final = "[283 13 82]"


@pytest.fixture(scope="module", autouse=True)
def _no_other_vehicles(states: States) -> None:
    """Names are given once."""
    states.clear()


def fact(dashboard: Dashboard, panel: str, title: str) -> Locator:
    """The reading with that title."""
    return dashboard.panel(panel).locator("dt", has_text=title).locator("xpath=following-sibling::dd")


def state_word(dashboard: Dashboard, word: str) -> Locator:
    return dashboard.page.get_by_role("main").get_by_text(word, exact=True)


def register_by_hand(dashboard: Dashboard, name: str, drone: Drone) -> int:
    page = dashboard.page
    dashboard.open("/vehicles")
    page.get_by_role("link", name="Register a vehicle").click()
    address = page.get_by_role("textbox", name="Address")
    page.get_by_label("Name").fill(name)
    page.get_by_role("checkbox", name="Simulation on this computer").check()
    address.fill("udp:nowhere")
    dashboard.button("Register vehicle").click()
    expect(address).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_text(re.compile("^must be udp:HOST:PORT"))).to_be_visible()
    expect(page.get_by_role("alert")).to_have_text("Correct the marked field: Address.")
    address.fill("udp:192.168.1.5:4245@4244")
    dashboard.button("Register vehicle").click()
    expect(page.get_by_role("alert")).to_have_text("Correct the marked field: Simulation on this computer.")
    expect(page.get_by_text("must be off for udp:192.168.1.5:4245@4244: a simulation has the address")).to_be_visible()
    address.fill(drone.address)
    dashboard.button("Register vehicle").click()
    page.wait_for_url(re.compile(r"/vehicles/\d+$"))
    return int(page.url.rsplit("/", 1)[1])


def test_a_vehicle_is_registered_connected_checked_and_disconnected_by_hand(dashboard: Dashboard) -> None:
    page = dashboard.page
    with Drone(speed=DRONE_SPEED) as drone:
        vehicle_id = register_by_hand(dashboard, "Bee", drone)
        expect(page.get_by_role("heading", level=1)).to_have_text("Bee")
        expect(state_word(dashboard, "Not connected")).to_be_visible()
        dashboard.button("Connect").click()
        expect(state_word(dashboard, "Ready")).to_be_visible()
        expect(fact(dashboard, "Connection", "Motors")).to_have_text("disarmed")
        expect(fact(dashboard, "Connection", "Link age")).to_have_text(re.compile(r"^0\.\d s$"))
        expect(fact(dashboard, "Battery", "Voltage")).to_have_text(re.compile(r"^1\d\.\d V$"))
        expect(dashboard.panel("Gains").get_by_text("Current gains are the safe gains")).to_be_visible()

        dashboard.button("Check now").click()
        passed = dashboard.panel("Preflight check").get_by_text("passed", exact=True)
        expect(passed.first).to_be_visible()
        checks = dashboard.get(f"/vehicles/{vehicle_id}")["checks"]
        expect(passed).to_have_count(len(checks))
        assert all(check["passed"] for check in checks)

        page.get_by_label("Battery label").fill("No. 3")
        dashboard.button("Save label").click()
        dashboard.until(lambda: dashboard.get(f"/vehicles/{vehicle_id}")["battery"] == "No. 3")

        given = dashboard.panel("Gain history").get_by_role("row").nth(1)
        expect(given).to_contain_text("Found at connection, nothing sent")
        expect(given.get_by_role("cell", name=SAFE_IN_BRACKETS, exact=True)).to_have_count(1)

        dashboard.button("Disconnect").click()
        expect(state_word(dashboard, "Not connected")).to_be_visible()
        asked = dashboard.get(f"/vehicles/{vehicle_id}/acts")["items"]
        assert [(act["kind"], act["state"]) for act in asked] == [
            ("disconnect", "done"),
            ("check", "done"),
            ("connect", "done"),
            ("safe gains", "done"),
        ]


def test_a_campaign_with_a_registered_vehicle_has_its_experiment(dashboard: Dashboard, states: States) -> None:
    page = dashboard.page
    vehicle_id = states.vehicle(
        "Moth", options={"autopilot": "px4", "address": "udpin:127.0.0.1:14998", "simulated": True}
    )
    dashboard.open("/new")
    expect(page.get_by_role("radio", name=re.compile("Moth"))).to_have_count(0)
    dashboard.button("Moth").click()
    expect(page.get_by_role("radio", name=re.compile("Moth"))).to_be_checked()
    expect(page.get_by_label("Name")).to_have_value(re.compile("PX4.*, Moth$"))
    dashboard.button("Create campaign").click()
    page.wait_for_url(re.compile(r"/campaigns/\d+$"))
    campaign = dashboard.get(f"/campaigns/{dashboard.campaign_id}")
    assert (campaign["vehicle"]["id"], campaign["definition"]["experiment"]) == (vehicle_id, "altitude-steps-px4")


def left_in_the_air(dashboard: Dashboard, server: Server, states: States, drone: Drone, name: str) -> int:
    """A vehicle whose process was killed in flight."""
    vehicle_id = states.vehicle(name, options={"address": drone.address, "simulated": True})
    dashboard.post(f"/vehicles/{vehicle_id}/connect")
    until_in_state(dashboard, vehicle_id, "ready")
    trial_id = states.plan(states.campaign("mavlink", name=name, vehicle_id=vehicle_id), TRIED)
    dashboard.open(f"/vehicles/{vehicle_id}")
    dashboard.post(f"/trials/{trial_id}/fly")
    expect(fact(dashboard, "Connection", "Altitude")).to_have_text(re.compile(r"^[23]\.\d\d m$"))
    os.kill(json.loads((server.data_dir / f"vehicle-{vehicle_id}.lock").read_text())["pid"], signal.SIGKILL)
    until_in_state(dashboard, vehicle_id, "quarantined")
    return vehicle_id


def slide_to_its_end(dashboard: Dashboard, knob: Locator) -> None:
    knob.scroll_into_view_if_needed()
    box = knob.bounding_box()
    assert box is not None
    x, y, mouse = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, dashboard.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 400, y, steps=8)
    mouse.up()


def until_in_state(dashboard: Dashboard, vehicle_id: int, state: str) -> None:
    dashboard.until(lambda: dashboard.get(f"/vehicles/{vehicle_id}")["state"] == state)


def test_a_vehicle_that_was_left_in_the_air_is_landed_looked_at_and_released(
    dashboard: Dashboard, shared_server: Server, states: States
) -> None:
    page = dashboard.page
    with Drone(speed=DRONE_SPEED) as drone:
        vehicle_id = left_in_the_air(dashboard, shared_server, states, drone, "Wasp")
        expect(page.get_by_role("heading", name="Quarantined: do not fly")).to_be_visible()
        expect(fact(dashboard, "Connection", "Motors")).to_have_text("armed")
        dashboard.button("Land now").click()
        expect(page.get_by_text("Land is repeated until the vehicle descends.")).to_be_visible()
        expect(dashboard.button("Restore safe gains")).to_be_disabled()
        expect(page.get_by_text("while it is armed, the vehicle is only monitored")).to_be_visible()
        expect(fact(dashboard, "Connection", "Altitude")).to_have_text(re.compile(r"^-?0\.[01]\d m$"))
        slide_to_its_end(dashboard, page.get_by_role("button", name="Motors off – the drone falls"))
        expect(fact(dashboard, "Connection", "Motors")).to_have_text("disarmed")
        expect(page.get_by_text("The motors are off.")).to_be_visible()
        expect(dashboard.button("Restore safe gains")).to_be_enabled()
        dashboard.open("/")
        card = page.get_by_role("listitem").filter(has=page.get_by_role("link", name="Wasp", exact=True))
        expect(card.get_by_text("Vehicle quarantined")).to_be_visible()
        card.get_by_role("link", name="Wasp", exact=True).click()
        expect(page.get_by_role("main").get_by_text("Vehicle quarantined")).to_be_visible()
        dashboard.open(f"/vehicles/{vehicle_id}")
        page.get_by_label("Inspected by, and findings").fill("Ada: it stands, nothing is broken")
        dashboard.button("Release vehicle").click()
        expect(state_word(dashboard, "Ready")).to_be_visible()
        assert dashboard.get(f"/vehicles/{vehicle_id}")["held"] == SAFE
        expect(dashboard.panel("Gain history")).to_contain_text("Safe gains at release")
        dashboard.post(f"/vehicles/{vehicle_id}/disconnect")
        until_in_state(dashboard, vehicle_id, "disconnected")


def test_a_disconnected_vehicle_is_edited_and_deleted_once_no_campaign_uses_it(
    dashboard: Dashboard, states: States
) -> None:
    page = dashboard.page
    vehicle_id = states.vehicle("Gnat", options={"address": "udp:127.0.0.1:14995@14994", "simulated": True})
    campaign_id = states.campaign("mavlink", vehicle_id=vehicle_id, name="Ladder")
    dashboard.open(f"/vehicles/{vehicle_id}")
    page.get_by_role("link", name="Edit").click()
    page.get_by_label("Name").fill("Hornet")
    page.get_by_role("textbox", name="Address", exact=True).fill("udp:nowhere")
    page.get_by_role("button", name=re.compile("^Advanced")).click()
    page.get_by_label("Lowest battery voltage to fly with").fill("11")
    dashboard.button("Save").click()
    expect(page.get_by_role("alert")).to_have_text("Correct the marked field: Address.")
    page.get_by_role("textbox", name="Address", exact=True).fill("udp:127.0.0.1:14993@14992")
    dashboard.button("Save").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Hornet")
    expect(dashboard.panel("Connection")).to_contain_text("udp:127.0.0.1:14993@14992")
    expect(fact(dashboard, "Battery", "Minimum to fly")).to_have_text("11.0 V")

    page.get_by_role("link", name="Edit").click()
    dashboard.button("Delete vehicle").click()
    dashboard.button("Delete with its gain history and commands").click()
    expect(page.get_by_role("alert")).to_contain_text("Hornet cannot be deleted: the campaign Ladder uses it.")
    states.delete_campaign(campaign_id)
    dashboard.button("Delete with its gain history and commands").click()
    page.wait_for_url(re.compile("/vehicles$"))
    expect(page.get_by_role("link", name="Register a vehicle")).to_be_visible()
    expect(page.get_by_role("link", name="Hornet")).to_have_count(0)
