"""A library of three recorded flights, analysed once for all tests of a process, and what tests make of its rows."""

from collections.abc import Mapping
from typing import Final

from app.db.models import AnalysedLogRow
from app.db.session import Database
from app.log_library.content import analyze_content
from app.log_library.service import analyze_upload
from tests.builders import made_once
from tests.logs.recorded import recorded

PATH: Final = "/api/log-analyses"
VEHICLES: Final = "/api/logged-vehicles"
FLOWN: Final = ("px4_takeoff.ulg", "arducopter_takeoff.bin", "paparazzi_283_13_82.tlog")
"""Those of which the analysis is the quickest, in the order of their flights."""


def library(database: Database) -> Mapping[str, int]:
    """Ids of three logs that are not kept, by the names of their files."""
    return made_once(database, "three analysed logs", lambda: {name: add(database, name) for name in FLOWN})


def add(database: Database, name: str, *, content: bytes | None = None, vehicle: int | None = None) -> int:
    """Analyse a recorded log, or that content, in this process; returns its id."""
    read = recorded(name) if content is None else content
    return analyze_upload(database, read, None, name=name, vehicle=vehicle, analyze=analyze_content).log.id


def change(database: Database, log_id: int, **fields: object) -> None:
    """Make a row what no recorded log makes it."""
    with database.write() as session:
        row = session.get_one(AnalysedLogRow, log_id)
        for name, value in fields.items():
            setattr(row, name, value)


def copied(database: Database, log_id: int, **fields: object) -> int:
    """Another log with the same answer, of another `digest` and with these fields; returns its id."""
    with database.write() as session:
        row = session.get_one(AnalysedLogRow, log_id)
        held = {each.key: getattr(row, each.key) for each in AnalysedLogRow.__table__.columns}
        made = AnalysedLogRow(**{**held, "id": None, "file_bytes": 0, **fields})
        session.add(made)
        session.flush()
        return made.id
