"""What `/api/health` says of vehicles that no order reaches."""

from concurrent.futures import Future

from fastapi.testclient import TestClient

from app.common.settings import Settings
from app.live.link import LiveServer
from app.live.messages import VehicleLinkState, VehicleStatus, live_address
from tests.builders import get
from tests.waiting import eventually


def status(vehicle_id: int, state: VehicleLinkState, trouble: str = "") -> VehicleStatus:
    at = "2026-11-24T00:00:00+00:00"
    return VehicleStatus(vehicle_id=vehicle_id, state=state, at=at, step="record", trouble=trouble)


def test_a_vehicle_whose_process_stands_still_is_named_until_it_goes_on(client: TestClient, settings: Settings) -> None:
    def named() -> object:
        return get(client, "/api/health")["vehicles_not_answering"]

    with LiveServer(
        live_address(settings.data_dir),
        abort=lambda *_: False,
        order=lambda *_: Future(),
    ) as worker:
        eventually(lambda: get(client, "/api/health")["worker"] == "running")
        worker.publish(status(4, "gone", "The telemetry log cannot be written."))
        worker.publish(status(5, "not answering", "Orders do not reach it."))
        eventually(lambda: named() == [{"vehicle_id": 5, "trouble": "Orders do not reach it."}])
        worker.publish(status(5, "connected"))
        eventually(lambda: named() == [])
        worker.publish(status(5, "not answering", "Orders do not reach it."))
        eventually(lambda: named() != [])
    eventually(lambda: named() == [])
    assert get(client, "/api/health")["worker"] == "absent"
