"""The list of campaigns: pages that stay right, filters, orders, and speed with thousands."""

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import (
    create_campaign,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    fly_trial,
    get,
    problems_of,
    run_jobs,
)

SORTS = ["-created", "created", "-updated", "name", "error"]


def names(client: TestClient, query: str) -> list[str]:
    return [item["name"] for item in get(client, f"/api/campaigns?{query}")["items"]]


@pytest.mark.complete
@pytest.mark.parametrize("sort", SORTS)
def test_pages_hold_everything_once_in_every_order(client: TestClient, sort: str) -> None:
    for index in range(7):
        create_campaign(client, name=f"C{index % 3}")
    whole = get(client, f"/api/campaigns?sort={sort}")
    assert (whole["total"], whole["next_cursor"], len(whole["items"])) == (7, None, 7)
    found, cursor = [], ""
    while True:
        page = get(client, f"/api/campaigns?sort={sort}&limit=3{cursor}")
        assert page["total"] == 7
        found += page["items"]
        if page["next_cursor"] is None:
            break
        cursor = f"&cursor={page['next_cursor']}"
    assert found == whole["items"]


def test_a_page_stays_right_when_something_is_added(client: TestClient) -> None:
    for index in range(4):
        create_campaign(client, name=f"C{index}")
    first = get(client, "/api/campaigns?limit=2")
    create_campaign(client, name="later")
    assert names(client, f"limit=2&cursor={first['next_cursor']}") == ["C1", "C0"]


@pytest.mark.complete
def test_the_list_can_be_searched_filtered_and_sorted(client: TestClient, database: Database) -> None:
    create_campaign(client, name="Windy 100% day", vehicle="jsbsim")
    create_campaign(client, name="calm_day")
    worse, better = (create_ready_campaign(client, database, name=name)["id"] for name in ("worse", "better"))
    create_flown_trial(client, database, worse, 2.0)
    create_flown_trial(client, database, better, 1.0)
    assert names(client, "search=DAY&sort=name") == ["calm_day", "Windy 100% day"]
    assert names(client, "search=100%25") == ["Windy 100% day"]
    assert names(client, "search=m_d") == ["calm_day"]
    assert names(client, "vehicle=jsbsim") == ["Windy 100% day"]
    assert names(client, "state=draft&state=ready&sort=created") == ["Windy 100% day", "calm_day"]
    assert names(client, "state=draft") == []
    assert names(client, "sort=error")[:2] == ["better", "worse"]


@pytest.mark.complete
def test_a_card_shows_what_matters(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 20}})
    others, best = {"kp": 283, "ki": 13, "kd": 82}, {"kp": 290, "ki": 20, "kd": 82}
    for settling_s in (2.0, 0.5, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6):
        fly_trial(
            client, database, campaign["id"], create_record(settling_s), gains=best if settling_s == 0.5 else others
        )
    run_jobs(database)
    (card,) = get(client, "/api/campaigns")["items"]
    assert (card["flights"], card["best"]["trial_number"], card["next_action"]) == (9, 2, "Fly the next flight")
    assert card["first_error"] > card["best"]["error"]
    assert [curve["trial_number"] for curve in card["spark"]] == [1, 2, 5, 6, 7, 8, 9]
    assert [curve["trial_number"] for curve in card["spark"] if curve["best"]] == [2]
    assert all(len(curve["time_s"]) == len(curve["values"]) <= 48 for curve in card["spark"])


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("limit=0", "limit"),
        ("limit=201", "limit"),
        ("limit=many", "limit"),
        ("sort=colour", "sort"),
        ("state=asleep", "state.0"),
        ("cursor=nonsense", "cursor"),
        ("cursor=bnVsbA", "cursor"),
        ("cursor=WyItY3JlYXRlZCIsIHRydWUsIDFd", "cursor"),
        ("sort=name&cursor=WyItY3JlYXRlZCIsIDEsIDFd", "cursor"),
        ("sort=-updated&cursor=WyItdXBkYXRlZCIsICJub3ciLCAxXQ", "cursor"),
    ],
)
def test_a_query_that_makes_no_sense_is_refused_by_field(client: TestClient, query: str, field: str) -> None:
    answer = client.get(f"/api/campaigns?{query}")
    assert answer.status_code == 422
    assert field in problems_of(answer)


@pytest.mark.complete
def test_a_card_compares_the_means_of_the_best_gains_and_of_the_first(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 20}})
    for settling_s, ki in ((1.5, 13), (1.3, 13), (1.0, 20)):
        fly_trial(client, database, campaign["id"], create_record(settling_s), gains={"kp": 283, "ki": ki, "kd": 82})
    groups = get(client, f"/api/campaigns/{campaign['id']}/statistics")["groups"]
    (card,) = get(client, "/api/campaigns")["items"]
    assert (card["first_error"], card["best"]["mean"]) == (groups[0]["mean"], groups[1]["mean"])
