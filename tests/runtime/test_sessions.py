"""Registered vehicles through web process, database, worker, a session's process and a real link."""

import os
import signal

import pytest

from tests.runtime.drones import OUR_PAGE, SAFE, SPEED, TRIED, connected
from tests.runtime.processes import Serving, stream
from tests.runtime.test_storage import locked
from tests.waiting import wait_for

pytestmark = pytest.mark.real_time("drones fly in processes of their own, over real UDP", about_s=20)
WINDOW_S = 12.0
"""Scored, of flights that the tests wait for."""


@pytest.mark.complete
def test_a_registered_vehicle_flies_and_holds_its_safe_gains_afterwards(serving: Serving) -> None:
    with connected(serving, "Flier") as (vehicle, _):
        ready = vehicle.in_state("ready")
        assert ready["held"] == SAFE
        assert ready["identity"]["autopilot"] == "paparazzi"
        trial_id = vehicle.planned(vehicle.campaign(window_s=WINDOW_S))
        with stream(serving.url) as events:
            serving.post(f"/trials/{trial_id}/fly")
            heard = []
            for name, _, data in events:
                heard.append(name if name != "vehicle" else data["step"])
                if name == "phase" and data["phase"] == "landed":
                    break
        flown = serving.trial(trial_id, "valid")
        assert {"arm", "record", "land"} <= set(heard), "the vehicle's own steps are shown while it flies"
        assert heard.count("telemetry") > WINDOW_S / SPEED * 20.0
        assert flown["read_back"] == TRIED
        assert flown["record"]["duration_s"] > WINDOW_S - 0.6
        assert vehicle.in_state("ready")["held"] == SAFE
        given = serving.get(f"/vehicles/{vehicle.id}/ledger")["items"]
        assert [(line["purpose"], line["asked"], line["read_back"]) for line in given] == [
            ("restore after flight", SAFE, SAFE),
            ("flight", TRIED, TRIED),
            ("connect", {}, SAFE),
        ]
        assert len(serving.api.get(f"/trials/{trial_id}/tlog").content) > 50_000
        assert vehicle.act("disconnect")["state"] == "done"
        assert vehicle.seen()["state"] == "disconnected"


@pytest.mark.complete
def test_a_real_vehicle_waits_for_its_operator_and_for_a_persons_verdict(serving: Serving) -> None:
    with connected(serving, "Real one", real=True) as (vehicle, _):
        assert vehicle.in_state("ready")["is_real"]
        checks = vehicle.act("check")
        assert checks["state"] == "done", checks["problem"]
        trial_id = vehicle.planned(vehicle.campaign(window_s=WINDOW_S))
        assert serving.api.post(f"/trials/{trial_id}/fly").status_code == 403
        serving.post(f"/trials/{trial_id}/stage")
        assert serving.trial(trial_id, "staged")["read_back"] == TRIED
        assert vehicle.status(lambda status: status["held"] == TRIED)["armed"] is False
        serving.post(f"/trials/{trial_id}/unstage")
        assert serving.trial(trial_id, "planned")["flight"]["end"]["request"]["by"] == "script"
        assert vehicle.in_state("ready")["held"] == SAFE

        serving.post(f"/trials/{trial_id}/stage")
        serving.trial(trial_id, "staged")
        lease = serving.api.put(f"/vehicles/{vehicle.id}/control", json={"operator": "Ada"}).json()
        token = {"X-Gainline-Control": lease["token"]}
        assert serving.api.post(f"/trials/{trial_id}/take-off", headers=token).status_code == 403, "no page of ours"
        assert serving.api.post(f"/trials/{trial_id}/take-off", headers=token | OUR_PAGE).status_code == 202
        flown = serving.trial(trial_id, "captured")
        assert vehicle.in_state("ready")["held"] == SAFE
        verdict = {"version": flown["version"], "outcome": "valid", "reason": "Ada watched it"}
        serving.post(f"/trials/{trial_id}/classify", verdict)
        assert serving.trial(trial_id, "valid")["error"] < 0.5 * 32.6 / WINDOW_S


@pytest.mark.complete
def test_an_abort_reaches_a_vehicle_in_the_air_while_the_database_is_locked(serving: Serving) -> None:
    with connected(serving, "Aborted") as (vehicle, _):
        trial_id = vehicle.planned(vehicle.campaign(window_s=WINDOW_S))
        vehicle.in_the_air(trial_id)
        with locked(serving):
            assert serving.post(f"/trials/{trial_id}/abort", {"reason": "enough"})["accepted"]
            landing = vehicle.status(lambda status: status["step"] in {"abort-land", "disarm", "restore", "idle"})
            assert landing["state"] == "connected"
        ended = serving.trial(trial_id, "aborted")
        assert ended["reason"] == "enough"
        assert ended["abort_cause"] == "operator"
        assert vehicle.in_state("ready")["held"] == SAFE
        (logged,) = [act for act in vehicle.acts() if act["kind"] == "abort"]
        assert logged["reason"].endswith(": enough")


@pytest.mark.complete
def test_a_vehicle_that_falls_silent_is_shown_as_gone_and_comes_back_by_itself(serving: Serving) -> None:
    with connected(serving, "Silent") as (vehicle, drone):
        drone.switch_off()
        assert vehicle.status(lambda status: status["state"] == "gone")["heartbeat_age_s"] > 3.0
        drone.switch_on()
        assert vehicle.status(lambda status: status["state"] == "connected")["armed"] is False


@pytest.mark.complete
def test_a_vehicle_whose_process_is_killed_in_the_air_is_landed_by_the_next_which_stops_no_motor(
    serving: Serving,
) -> None:
    with connected(serving, "Orphan") as (vehicle, _):
        trial_id = vehicle.planned(vehicle.campaign(window_s=WINDOW_S))
        vehicle.in_the_air(trial_id)
        vehicle.kill_session()
        assert "exit code -9" in serving.trial(trial_id, "lost")["reason"]
        # The newest status may still be that of the killed process, which had no concern.
        observed = vehicle.status(lambda status: status["state"] == "connected" and status["concern"])
        assert observed["armed"]
        found = vehicle.in_state("quarantined")
        assert {"land", "motors off", "release"} <= set(found["actions"])
        assert "stage" not in found["actions"]
        refused = vehicle.act("restore")
        assert (refused["state"], "armed" in refused["problem"]) == ("failed", True), "nothing is written to it"
        down = vehicle.status(lambda status: status["altitude_m"] < 0.15)
        assert (down["armed"], vehicle.orders()) == (True, []), "nobody has ordered it"
        told = "The process that flew it ended in flight. Land is repeated"
        assert (told in down["concern"], told in vehicle.seen()["concern"]) == (True, True)
        assert next(act for act in vehicle.acts() if act["kind"] == "connect")["reason"] in down["concern"]
        assert serving.post(f"/vehicles/{vehicle.id}/motors-off", {"reason": "it is down"})["accepted"]
        vehicle.status(lambda status: status["armed"] is False)
        orders = wait_for("the order in the database", lambda: vehicle.orders() if len(vehicle.orders()) == 1 else None)
        assert [(act["kind"], act["reason"], act["state"]) for act in orders] == [("motors off", "it is down", "done")]
        serving.post(f"/vehicles/{vehicle.id}/release", {"statement": "Ada has looked at it"})
        assert vehicle.in_state("ready")["held"] == SAFE


@pytest.mark.complete
def test_a_vehicle_in_the_air_is_landed_when_the_worker_is_killed_and_is_there_again(serving: Serving) -> None:
    with connected(serving, "Left") as (vehicle, _):
        trial_id = vehicle.planned(vehicle.campaign(window_s=WINDOW_S))
        vehicle.in_the_air(trial_id)
        before, session = serving.worker_pid(), vehicle.session_pid()
        os.kill(before, signal.SIGKILL)
        assert serving.trial(trial_id, "lost")["reason"] == "the worker stopped during the flight"
        wait_for("a session of the new worker", lambda: vehicle.session_pid() not in {0, session})
        assert vehicle.in_state("ready")["held"] == SAFE
        assert serving.worker_pid() != before
        assert vehicle.status(lambda status: status["state"] == "connected")["armed"] is False


@pytest.mark.complete
def test_a_vehicle_whose_process_stands_still_takes_no_order_and_does_not_fly_when_it_goes_on(serving: Serving) -> None:
    with connected(serving, "Still") as (vehicle, _):
        trial_id = vehicle.planned(vehicle.campaign(window_s=WINDOW_S))
        serving.post(f"/trials/{trial_id}/stage")
        serving.trial(trial_id, "staged")
        session = vehicle.session_pid()
        os.kill(session, signal.SIGSTOP)
        try:
            serving.post(f"/trials/{trial_id}/take-off")
            serving.trial(trial_id, "flying")
            shown = vehicle.status(lambda status: status["state"] == "not answering")
            named = serving.get("/health")["vehicles_not_answering"]
            assert named == [{"vehicle_id": vehicle.id, "trouble": shown["trouble"]}]
            for order in ("land", "motors-off"):  # which takes longer than a takeoff is still in time
                told = serving.post(f"/vehicles/{vehicle.id}/{order}", {"reason": "nobody answers"})
                assert (told["accepted"], "remote control" in told["sentence"]) == (False, True)
        finally:
            os.kill(session, signal.SIGCONT)
        assert "too late" in serving.trial(trial_id, "planned")["flight"]["problem"]
        ready = vehicle.status(lambda status: status["state"] == "connected")
        assert (ready["armed"], ready["trouble"]) == (False, "")
        assert serving.get("/health")["vehicles_not_answering"] == []
        assert vehicle.in_state("ready")["held"] == SAFE
        orders = wait_for(
            "the orders in the database", lambda: vehicle.orders() if len(vehicle.orders()) == 2 else None
        )
        assert [(act["kind"], act["state"], "too late" in act["problem"]) for act in orders] == [
            ("motors off", "failed", True),
            ("land", "failed", True),
        ]
