"""What the tuning engine knows, on the screen: intervals, repeats, refusals, glitches, warm starts, experiments."""

import re
from functools import partial

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.dashboard import Dashboard, printed
from tests.e2e.states import States

PATIENT = {"kind": "budget", "max_flights": 20}
WRAPPING = {"kp": 283, "ki": 1356, "kd": 82}
"""The paper's Table 2: ki·(sum of errors) can wrap at 32 bits."""


def test_the_next_flight_is_drawn_with_its_band_and_interval_and_the_fitted_parameters_are_told(
    dashboard: Dashboard, states: States
) -> None:
    campaign_id = states.campaign(strategy="calibrated", seed=3, stop=PATIENT, flights=1)
    dashboard.open_campaign(campaign_id)
    curve, lower, upper = (dashboard.until(partial(dashboard.trace, "takeoffs", *what[:1], **what[1])) for what in (
        ("prediction", {}), ("band", {"edge": "lower"}), ("band", {"edge": "upper"})))  # fmt: skip
    middle = np.interp(curve["x"], lower["x"], lower["y"]), np.interp(curve["x"], upper["x"], upper["y"])
    assert (middle[0] <= np.array(curve["y"]) + 0.01).all()
    assert (middle[1] >= np.array(curve["y"]) - 0.01).all()
    assert (middle[1] - middle[0]).max() > 0.01
    interval = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]["interval"]
    drawn = dashboard.until(lambda: dashboard.trace("errors", "interval"))
    assert (drawn["x"][-3:-1], drawn["y"][-3:-1]) == (
        [2, 2],
        pytest.approx([interval["lower"], interval["upper"]], abs=1e-6),
    )
    why = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]["explanation"]
    card = dashboard.panel("Next: flight 2")
    card.get_by_text("Explanation").click()
    assert len(why["fitted"]) >= 4
    for one in why["fitted"]:
        term = dashboard.page.get_by_role("term").filter(has_text=one["title"])
        value = printed(one["value"], one["standard_error"], "").strip()
        expect(card.locator("dl > div").filter(has=term)).to_contain_text(value)
    expect(card).to_contain_text(why["lesson"])
    card.get_by_role("button", name="What is the interval?").click()
    expect(dashboard.page.get_by_text("Nine out of ten flights should fall inside it")).to_be_visible()


def test_a_repeat_by_its_button_becomes_a_group_with_a_mean_and_a_standard_error(
    dashboard: Dashboard, states: States
) -> None:
    campaign_id = states.campaign(strategy="gradient", seed=3, stop=PATIENT, flights=2)
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("Max")
    dashboard.choose("Repeat")
    dashboard.fly()
    dashboard.until(lambda: [one["state"] for one in dashboard.trials(campaign_id)] == ["valid"] * 3)
    flown = dashboard.trials(campaign_id)
    assert flown[2]["gains"] == flown[1]["gains"]
    said = dashboard.get(f"/campaigns/{campaign_id}/statistics")
    [group] = [one for one in said["groups"] if len(one["trial_numbers"]) > 1]
    assert group["mean"] == pytest.approx(np.mean([one["error"] for one in flown[1:]]), abs=1e-9)
    dashboard.open_tab("Statistics")
    panel = dashboard.panel("Statistics")
    row = panel.get_by_role("row").filter(has_text="2, 3")
    expect(row).to_contain_text(printed(group["mean"], group["standard_error"]))
    expect(panel).to_contain_text(
        {"better": "Better", "worse": "Worse"}.get(said["comparison"]["verdict"], "Unresolved")
    )
    expect(panel).to_contain_text(f"{said['track_record']['inside']} of {said['track_record']['of']}")
    dashboard.open_tab("Error and gains")
    dashboard.until(lambda: dashboard.trace("errors", "repeats") is not None)
    repeats, measured = dashboard.trace("errors", "repeats"), dashboard.trace("errors", "measured")
    assert repeats is not None and measured is not None  # noqa: PT018
    assert repeats["y"] == pytest.approx([group["mean"]], abs=1e-6)
    assert repeats["bars"] == pytest.approx([group["standard_error"]], abs=1e-6)
    assert measured["bar"] == pytest.approx(said["sigma"], abs=1e-6)
    shown = dashboard.panel("Flight 3")
    expect(shown).to_contain_text(printed(group["mean"], group["standard_error"]))


def refuse(page: Page) -> None:
    page.get_by_role("radiogroup", name="Gains to fly").get_by_text("Custom gains").click()
    for name, value in WRAPPING.items():
        page.get_by_role("textbox", name=name).fill(str(value))


def test_a_refusal_offers_the_nearest_value_that_would_pass(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign("twin", step_fraction=1.0, first_step_fraction=1.0)
    dashboard.open_campaign(campaign_id)
    refuse(dashboard.page)
    ki = dashboard.page.get_by_role("textbox", name="ki")
    expect(ki).to_have_attribute("aria-invalid", "true")
    expect(dashboard.page.get_by_text(re.compile("stuck on the ground"))).to_be_visible()
    expect(dashboard.fly_button).to_be_disabled()
    dashboard.button("Use ki 1073").click()
    expect(ki).to_have_value("1073")
    expect(ki).not_to_have_attribute("aria-invalid", "true")
    expect(dashboard.page.get_by_text(re.compile("stuck on the ground"))).to_have_count(0)
    assert dashboard.trials(campaign_id) == []


def test_a_refusal_is_overruled_on_a_simulation_only_with_a_reason_which_stays_with_the_flight(
    dashboard: Dashboard, states: States
) -> None:
    campaign_id = states.campaign("twin")
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("Max")
    refuse(dashboard.page)
    dashboard.page.get_by_text("Overrule the gate", exact=True).click()
    fly = dashboard.button("Fly refused gains")
    expect(fly).to_be_disabled()
    dashboard.page.get_by_label("Reason").fill("the paper flew these gains")
    fly.click()
    dashboard.until(lambda: [one["state"] for one in dashboard.trials(campaign_id)] in (["valid"], ["captured"]))
    [trial] = dashboard.trials(campaign_id)
    assert (trial["gains"]["ki"], trial["overrule_reason"]) == (1356, "the paper flew these gains")
    verdict = dashboard.panel("Flight 1")
    expect(verdict.get_by_text("Gate overruled", exact=True)).to_be_visible()
    expect(verdict).to_contain_text("the paper flew these gains")


def test_glitches_of_an_uploaded_record_are_marked_and_told_with_both_errors(
    dashboard: Dashboard, states: States
) -> None:
    time_s = np.arange(0.0, 33.0, 0.02)
    altitude_m = 3.0 * (1.0 - np.exp(-time_s))
    altitude_m[500:505] += 1.5
    content = "time_s,altitude_m\n" + "".join(f"{t:.3f},{z:.5f}\n" for t, z in zip(time_s, altitude_m, strict=True))
    campaign_id = states.campaign("import")
    dashboard.open_campaign(campaign_id)
    with dashboard.page.expect_file_chooser() as chooser:
        dashboard.button("Upload flight record").click()
    chooser.value.set_files({"name": "flight.csv", "mimeType": "text/csv", "buffer": content.encode()})
    expect(dashboard.page.get_by_text("The record has a glitch")).to_be_visible()
    dashboard.button("Review flight 1").click()
    expect(dashboard.button("Mark valid")).to_be_in_viewport()
    [trial] = dashboard.trials(campaign_id)
    assert trial["glitches"]
    assert trial["repaired_error"] < trial["error"]
    told = dashboard.page.get_by_text(f"with the glitches interpolated {trial['repaired_error']:.3f} m")
    expect(told).to_be_visible()
    dashboard.until(lambda: dashboard.trace("takeoffs", "glitch", trial=1) is not None)
    drawn = dashboard.trace("takeoffs", "glitch", trial=1)
    assert drawn is not None
    seconds = [value for value in drawn["x"] if value is not None]
    assert min(seconds) == pytest.approx(10.0, abs=0.1)
    assert max(seconds) == pytest.approx(10.1, abs=0.1)


def test_a_new_campaign_starts_from_the_best_of_another_one(dashboard: Dashboard, states: States) -> None:
    donor = states.campaign(name="Donor of the warm start", strategy="calibrated", flights=2)
    page = dashboard.page
    dashboard.open("/new")
    recommended = dashboard.get("/catalogue")["strategies"][0]
    expect(page.get_by_role("combobox", name="Strategy")).to_have_value(recommended["name"])
    page.get_by_role("combobox", name="Start from").select_option("Best gains of another campaign")
    page.get_by_role("searchbox", name="Campaign").fill("Donor of the warm")
    page.get_by_role("button", name=re.compile("^Donor of the warm start")).click()
    best = dashboard.get(f"/campaigns/{donor}")["best"]
    expect(page.get_by_text(f"kp {best['gains']['kp']}")).to_be_visible()
    page.get_by_role("textbox", name="Name").fill("Warm start")
    dashboard.button("Create campaign").click()
    expect(page.get_by_role("heading", name="Warm start")).to_be_visible()
    start = dashboard.get(f"/campaigns/{dashboard.campaign_id}")["definition"]["start"]
    assert (start["kind"], start["gains"]) == ("campaign", best["gains"])
    assert (start["donor"]["campaign_id"], start["donor"]["trial_number"]) == (donor, best["trial_number"])


def test_another_experiment_has_its_own_vehicles_gains_and_units(dashboard: Dashboard, states: States) -> None:
    page = dashboard.page
    dashboard.open("/new")
    experiment = next(one for one in dashboard.get("/catalogue")["experiments"] if one["name"] == "pitch-tracking")
    page.get_by_role("combobox", name="Experiment").select_option(experiment["title"])
    expect(page.get_by_role("radio")).to_have_count(1)
    page.get_by_role("textbox", name="Name").fill("F-16 by hand")
    dashboard.button("Create campaign").click()
    expect(page.get_by_role("heading", name="F-16 by hand")).to_be_visible()
    campaign_id = dashboard.when_ready(dashboard.campaign_id)
    states.fly(campaign_id)
    [trial] = dashboard.trials(campaign_id)
    unit = experiment["error_unit"]
    expect(dashboard.panel("Flight 1")).to_contain_text(re.compile(rf"Error ?{trial['error']:.4f} ± [\d.]+ {unit}"))
    expect(page.get_by_role("heading", name="Pitch error curves")).to_be_visible()
    dashboard.until(lambda: dashboard.trace("Pitch error curves", "flight") is not None)
    drawn = dashboard.trace("Pitch error curves", "flight")
    assert drawn is not None
    record = dashboard.get(f"/trials/{trial['id']}/trajectory?points=20000")
    expected = np.interp(drawn["x"], record["time_s"], record["channels"][experiment["output"]])
    np.testing.assert_allclose(drawn["y"], expected, atol=2e-4)


def test_altitude_steps_are_created_in_the_form_and_flown_twice_close_to_the_reference(
    dashboard: Dashboard, states: States
) -> None:
    page = dashboard.page
    dashboard.open("/new")
    page.get_by_role("combobox", name="Experiment").select_option("Altitude steps")
    expect(page.get_by_role("radio", name=re.compile("AR.Drone 2"))).to_have_count(2)
    page.get_by_role("button", name=re.compile("^Advanced")).click()
    page.get_by_label("Number of steps").fill("2")
    page.get_by_role("textbox", name="Name", exact=True).fill("Steps")
    dashboard.button("Create campaign").click()
    expect(page.get_by_role("heading", name="Steps", exact=True)).to_be_visible()
    campaign_id = dashboard.when_ready(dashboard.campaign_id)
    states.fly(campaign_id)
    dashboard.when_ready(campaign_id)
    states.fly(campaign_id)
    first, second = dashboard.trials(campaign_id)
    assert second["error"] < 0.05 * first["error"]
    expect(page.get_by_role("heading", name=re.compile("^Altitude steps"))).to_be_visible()
    drawn = dashboard.until(lambda: dashboard.trace("Altitude steps", "flight", trial=2))
    record = dashboard.get(f"/trials/{second['id']}/trajectory?points=20000")
    reference = np.interp(drawn["x"], record["time_s"], record["channels"]["reference_m"])
    shown = np.array(drawn["x"]) > 10.0
    np.testing.assert_allclose(np.array(drawn["y"])[shown], reference[shown], atol=0.05)
