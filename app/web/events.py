"""Server-sent events, one stream per browser tab: what changed, and telemetry during flights."""

import asyncio
from collections.abc import AsyncIterator
from datetime import timedelta
from typing import Annotated

from fastapi import APIRouter, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent

from app import __version__
from app.db.base import utc_now
from app.db.models import EventRow
from app.db.outbox import holds_everything_after, latest_event_before, latest_event_id
from app.db.session import Database
from app.live.hub import LinkState, LiveItem, changes_after
from app.live.messages import FlightPhase, Telemetry, VehicleStatus, encode
from app.web.dependencies import CurrentDatabase, Live

router = APIRouter(prefix="/api", tags=["events"])


@router.get("/events", response_class=EventSourceResponse)
async def events(
    live: Live,
    database: CurrentDatabase,
    last_event_id: Annotated[str | None, Header()] = None,
    since_s: Annotated[
        float,
        Query(ge=0.0, le=60.0, description="length in seconds of the recent past whose changes are sent first"),
    ] = 0.0,
) -> AsyncIterator[ServerSentEvent]:
    """Stream all events.

    `hello` opens the stream: version, and whether a worker is there. `change` names a thing that changed (topic,
    entity_id, campaign_id); those of the last `since_s` seconds come first, for a client that has just read something.
    Its id lets a client that reconnects with `Last-Event-ID` miss nothing, even after a restart of the server. `reset`:
    that id is unknown here, load everything again. `telemetry` and `phase` come from a running flight, `vehicle` five
    times a second from a connected vehicle. `worker` tells whether the worker is there: when that changes, and every
    three seconds, so that a client detects a dead connection by silence. These carry no id and may be dropped for a
    slow client.
    """
    with live.hub.subscribe() as stream:
        sent, known = await asyncio.to_thread(_start, database, last_event_id, since_s)
        yield ServerSentEvent(
            event="hello",
            id=None if last_event_id else str(sent),
            retry=1000,
            data={"version": __version__, "worker": live.client.answers},
        )
        if not known:
            yield ServerSentEvent(event="reset", id=str(sent), data={})
        for change in await asyncio.to_thread(list, changes_after(database, sent)):
            yield _event(change)
            sent = change.id
        async for item in stream:
            if isinstance(item, EventRow):
                if item.id <= sent:
                    continue
                sent = item.id
            yield _event(item)


def _start(database: Database, last_event_id: str | None, since_s: float) -> tuple[int, bool]:
    """The event id after which the stream begins, and whether all events since the client's last one are still
    stored."""
    with database.read() as session:
        latest = latest_event_id(session)
        if not last_event_id:
            since = utc_now() - timedelta(seconds=since_s)
            return latest if since_s == 0.0 else latest_event_before(session, since), True
        if last_event_id.isdecimal() and holds_everything_after(session, int(last_event_id)):
            return int(last_event_id), True
        return latest, False


def _event(item: EventRow | LiveItem) -> ServerSentEvent:
    match item:
        case EventRow():
            return ServerSentEvent(
                event="change",
                id=str(item.id),
                data={"topic": item.topic, "entity_id": item.entity_id, "campaign_id": item.campaign_id},
            )
        case LinkState():
            return ServerSentEvent(event="worker", data={"worker": item.worker})
        case Telemetry() | FlightPhase() | VehicleStatus():
            return ServerSentEvent(event=item.type, raw_data=encode(item).decode().rstrip())
