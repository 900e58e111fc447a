"""Processor time of the log library's lists with 500 kept logs, and what a log takes in the database.

    ./dev exec python -m bench.log_library

Analyses a recorded log of ArduCopter and one of PX4, and two made ones of 120 s with as many parameters as a vehicle
has; their answers are stored 500 times, for 20 vehicles, as rows of a real database. Measures the answers of the
application over HTTP, in this process: the list of logs by one page and by all its pages of 50, and of each vehicle its
page and its trend. Exits with 1 if one takes longer than its limit, in proportion on a slower machine, or if a log is
larger.
"""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import partial
from pathlib import Path
from statistics import median
from typing import Final

from fastapi.testclient import TestClient
from sqlalchemy import text

from app.common.settings import Settings
from app.db.base import utc_now
from app.db.migrate import migrate
from app.db.models import AnalysedLogRow, LoggedVehicleRow
from app.db.session import Database
from app.log_library.content import analyze_content
from app.log_library.library_schemas import AnalysedContent
from app.log_library.stored_logs import store
from app.main import create_app
from bench.timing.machine import measured_slowness
from tests.logs.recorded import recorded
from tests.logs.written_tlog import PX4_RECORDING, Recording

LOGS: Final = 500
VEHICLES: Final = 20
PAGE: Final = 50
ROUNDS: Final = 5
LIST_LIMIT_S: Final = 0.05
TREND_LIMIT_S: Final = 0.15
LARGEST_BYTES: Final = 60 * 2**10
FLOWN_S: Final = 120.0
"""Of the logs that are made; the altitude changes by 2 m every 7 s."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Something measured: what of, how much, its limit, and a unit with its size."""

    what: str
    value: float
    limit: float
    unit: str
    size: float


def analysed() -> Iterator[AnalysedContent]:
    """The recorded logs, and those of 120 s with the parameters of a recorded vehicle."""
    files = {name: recorded(name) for name in ("arducopter_steps.bin", "px4_steps.ulg")}
    found = {name: analyze_content(content, None, name) for name, content in files.items()}
    yield from found.values()
    changes = [(10.0 + 7.0 * place, 5.0 + 2.0 * ((place + 1) % 2)) for place in range(15)]
    for name, like, recording in (
        ("made_arducopter.tlog", "arducopter_steps.bin", Recording()),
        ("made_px4.tlog", "px4_steps.ulg", PX4_RECORDING),
    ):
        parameters = {**found[like].parameters, **recording.parameters}
        flown = replace(recording, set_points=((0.0, 5.0), *changes), lasts_s=FLOWN_S, parameters=parameters)
        yield analyze_content(flown.content, None, name)


def fill(database: Database, found: Sequence[AnalysedContent]) -> None:
    """Store the answers, and copies of them: in turn for every vehicle, a log a day."""
    now = utc_now()
    with database.write() as session:
        rows = [session.get_one(AnalysedLogRow, store(session, each, each.answer.file_name, "")) for each in found]
        names = [column.key for column in AnalysedLogRow.__table__.columns]
        answers = [{name: getattr(row, name) for name in names if name != "id"} for row in rows]
        for row in rows:
            session.delete(row)
        for place in range(VEHICLES):
            vehicle = LoggedVehicleRow(name=f"Vehicle {place}", hardware_id=f"{place:08x}")
            for number in range(place, LOGS, VEHICLES):
                own = {"digest": str(number), "vehicle": vehicle, "ordered_at": now - timedelta(days=number)}
                kept = {name: value for name, value in answers[number % len(answers)].items() if name != "vehicle_id"}
                session.add(AnalysedLogRow(**kept | own))


def bytes_of(database: Database) -> dict[str, int]:
    """Bytes of the largest row of every file: answer, flight, numbers and fit."""
    packed = "length(answer) + coalesce(length(flight), 0) + length(numbers) + coalesce(length(fit), 0)"
    with database.read() as session:
        wanted = text(f"SELECT file_name, max({packed}) FROM analysed_log GROUP BY file_name")
        return {str(name): int(size) for name, size in session.execute(wanted).all()}


def processor_s(work: Callable[[], object]) -> float:
    """Processor time of all threads, s; the median of several rounds after a first one."""
    work()
    taken = []
    for _ in range(ROUNDS):
        before_s = time.process_time()
        work()
        taken.append(time.process_time() - before_s)
    return median(taken)


def listed(client: TestClient) -> None:
    """Read all pages of the list."""
    query, logs = {"limit": str(PAGE)}, 0
    while True:
        page = client.get("/api/log-analyses", params=query).json()
        logs += len(page["items"])
        if page["next_cursor"] is None:
            break
        query["cursor"] = page["next_cursor"]
    assert logs == LOGS


def measure(client: TestClient) -> Iterator[Measured]:
    """Processor times of the lists and of the slowest vehicle."""
    one_page = processor_s(lambda: client.get("/api/log-analyses", params={"limit": PAGE}).raise_for_status())
    yield Measured(f"a page of {PAGE} logs", one_page, LIST_LIMIT_S, "ms", 1e-3)
    pages = LOGS // PAGE
    yield Measured(f"all {LOGS} logs, a page", processor_s(lambda: listed(client)) / pages, LIST_LIMIT_S, "ms", 1e-3)
    vehicles = processor_s(lambda: client.get("/api/logged-vehicles").raise_for_status())
    yield Measured(f"the {VEHICLES} vehicles", vehicles, LIST_LIMIT_S, "ms", 1e-3)
    ids = [each["id"] for each in client.get("/api/logged-vehicles").json()]
    assert len(ids) == VEHICLES

    def read(vehicle: int) -> None:
        client.get(f"/api/logged-vehicles/{vehicle}").raise_for_status()
        client.get(f"/api/logged-vehicles/{vehicle}/trend").raise_for_status()

    slowest = max(processor_s(partial(read, each)) for each in ids)
    yield Measured(f"a vehicle of {LOGS // VEHICLES} logs with its trend", slowest, TREND_LIMIT_S, "ms", 1e-3)


def main() -> int:
    with tempfile.TemporaryDirectory() as folder, measured_slowness() as slowness:
        settings = Settings(data_dir=Path(folder), ui_dir=Path(folder) / "ui", port=0)
        migrate(settings.database_file)
        application = create_app(settings)
        with TestClient(application, base_url="http://127.0.0.1:8000", client=("127.0.0.1", 50000)) as client:
            database = application.state.database
            fill(database, list(analysed()))
            times = list(measure(client))
            sizes = [Measured(name, size, LARGEST_BYTES, "KiB", 2**10) for name, size in bytes_of(database).items()]
            database_bytes = settings.database_file.stat().st_size
    slow = slowness()
    print(f"{LOGS} logs: {database_bytes / 2**20:.1f} MiB; machine slower by {slow:.2f}")
    for each in (*times, *sizes):
        print(
            f"{each.what:36} {each.value / each.size:6.1f} {each.unit} (limit {each.limit / each.size:.0f} {each.unit})"
        )
    is_quick = all(each.value <= each.limit * slow for each in times)
    return 0 if is_quick and all(each.value <= each.limit for each in sizes) else 1


if __name__ == "__main__":
    sys.exit(main())
