"""The fan-out to event streams."""

import asyncio
import sqlite3
import threading
from dataclasses import replace
from functools import cache
from pathlib import Path

from app.db.models import EventRow
from app.db.outbox import DatabaseWatch
from app.live.hub import WAITING_CHANGES, WAITING_TELEMETRY, Hub, LinkState, LiveItem
from app.live.messages import FlightPhase, Telemetry, VehicleStatus
from tests.waiting import Waits


@cache
def change(number: int) -> EventRow:
    """The same row for the same number: rows are equal only to themselves."""
    return EventRow(id=number, topic="trial", entity_id=7, campaign_id=1)


def telemetry(time_s: float) -> Telemetry:
    return Telemetry(campaign_id=1, trial_id=7, time_s=time_s, columns=[], samples=[], error_so_far=None)


def test_a_slow_stream_gets_every_change_and_only_the_newest_telemetry() -> None:
    async def scenario() -> list[EventRow | LiveItem]:
        hub = Hub()
        with hub.subscribe() as stream:
            for number in range(500):
                hub.publish(telemetry(float(number)))
                hub.publish(change(number))
            items = aiter(stream)
            return [await anext(items) for _ in range(500 + WAITING_TELEMETRY)]

    items = asyncio.run(scenario())
    assert [item.id for item in items if isinstance(item, EventRow)] == list(range(500))
    assert [item.time_s for item in items if isinstance(item, Telemetry)] == [float(n) for n in range(400, 500)]


def test_two_streams_see_the_same() -> None:
    async def collect(hub: Hub, items: list[EventRow | LiveItem]) -> None:
        with hub.subscribe() as stream:
            items.extend([item async for item in stream])

    async def scenario() -> tuple[list[EventRow | LiveItem], list[EventRow | LiveItem]]:
        hub = Hub()
        first: list[EventRow | LiveItem] = []
        second: list[EventRow | LiveItem] = []
        tasks = [asyncio.create_task(collect(hub, items)) for items in (first, second)]
        await asyncio.sleep(0)
        for item in (change(1), telemetry(0.1), LinkState(worker=False), change(2)):
            hub.publish(item)
            await asyncio.sleep(0.01)
        hub.close()
        await asyncio.gather(*tasks)
        return first, second

    first, second = asyncio.run(scenario())
    assert first == second == [change(1), telemetry(0.1), LinkState(worker=False), change(2)]


def test_a_stream_that_joins_late_gets_the_flight_from_its_command_on() -> None:
    def sample(time_s: float) -> Telemetry:
        row, columns = [time_s, 0.1, 0.6], ["time_s", "altitude_m", "thrust"]
        return Telemetry(campaign_id=1, trial_id=7, time_s=time_s, columns=columns, samples=[row], error_so_far=2.9)

    async def first_heard(hub: Hub, now_s: float) -> list[float]:
        """Times of the first telemetry that a new stream gets, while the flight goes on."""
        with hub.subscribe() as stream:
            hub.publish(sample(now_s))
            item = await anext(aiter(stream))
            assert isinstance(item, Telemetry)
            return [row[0] for row in item.samples]

    async def scenario() -> tuple[list[float], list[float], list[float]]:
        hub = Hub()
        hub.publish(sample(0.1))
        hub.publish(sample(0.2))
        joined = await first_heard(hub, 0.3)
        hub.publish(FlightPhase(campaign_id=1, trial_id=7, phase="landed"))
        after_landing = await first_heard(hub, 0.1)
        hub.publish(LinkState(worker=False))
        return joined, after_landing, await first_heard(hub, 0.4)

    assert asyncio.run(scenario()) == ([0.1, 0.2], [0.1], [0.4])


def test_a_stream_that_joins_late_is_told_how_the_vehicles_are_while_there_is_a_worker(tmp_path: Path) -> None:
    def status(vehicle_id: int, altitude_m: float) -> VehicleStatus:
        return VehicleStatus(vehicle_id=vehicle_id, state="connected", at="", step="record", altitude_m=altitude_m)

    async def first_heard(hub: Hub, count: int) -> list[EventRow | LiveItem]:
        with hub.subscribe() as stream:
            hub.publish(change(1))
            items = aiter(stream)
            return [await anext(items) for _ in range(count)]

    async def scenario() -> None:
        hub = Hub()
        for item in (status(5, 0.1), status(6, 0.0), status(5, 2.9)):
            hub.publish(item)
        first, *told = await first_heard(hub, 3)
        assert first == change(1)
        assert [replace(one, age_s=0.0) for one in told if isinstance(one, VehicleStatus)] == [
            status(5, 2.9), status(6, 0.0)]  # fmt: skip
        hub.publish(LinkState(worker=False))
        assert await first_heard(hub, 1) == [change(1)]

    asyncio.run(scenario())


def test_what_is_told_once_more_says_how_old_it_is_so_that_a_worker_that_hangs_does_not_look_alive() -> None:
    now_s = 100.0
    hub = Hub(lambda: now_s)
    hub.publish(VehicleStatus(vehicle_id=5, state="connected", at="", step="record", packet_age_s=0.1))
    now_s += 1.5
    hub.publish(telemetry(0.1))
    now_s += 2.5
    assert [(type(one), one.age_s) for one in hub.snapshot() if not isinstance(one, FlightPhase)] == [
        (VehicleStatus, 4.0), (Telemetry, 2.5)]  # fmt: skip


def test_a_stream_too_far_behind_is_ended_so_that_it_resumes_from_the_database() -> None:
    async def scenario() -> int:
        hub = Hub()
        with hub.subscribe() as stream:
            for number in range(WAITING_CHANGES + 1):
                hub.publish(change(number))
            return len([item async for item in stream])

    assert asyncio.run(scenario()) == 0


def test_a_closed_hub_ends_open_and_new_streams() -> None:
    async def scenario() -> None:
        hub = Hub()
        async with asyncio.timeout(Waits.at_most_s):
            with hub.subscribe() as stream:
                hub.close()
                assert [item async for item in stream] == []
            with hub.subscribe() as late:
                assert [item async for item in late] == []

    asyncio.run(scenario())


def test_the_watch_sees_other_connections_commits_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a file with ?&#.sqlite3"
    with sqlite3.connect(path) as writer:
        writer.execute("CREATE TABLE t (x)")
        with DatabaseWatch(path) as watch:
            assert watch.changed()
            assert not watch.changed()
            writer.execute("INSERT INTO t VALUES (1)")
            assert not watch.changed()
            writer.commit()
            assert watch.changed()
            assert not watch.wait(threading.Event(), 0.04)
            stop = threading.Event()
            stop.set()
            assert not watch.wait(stop, 60)
    writer.close()
