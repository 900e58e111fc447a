"""The migrations make the tables of the models; a database of another revision is refused with what to do."""

import sqlite3
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from fastapi.testclient import TestClient
from sqlalchemy import CheckConstraint

from app.common.errors import SchemaError, StorageError
from app.common.settings import Settings
from app.db.base import Base
from app.db.migrate import migrate, require_current, revision_of
from app.db.models import TrajectoryRow, TrialRow
from app.db.revision import REVISION, is_current
from app.db.session import Database, open_engine
from app.main import create_app
from tests.builders import (
    Json,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    get,
    land,
    lift_off,
    run_jobs,
)


def test_the_newest_migration_is_the_one_that_the_program_works_with() -> None:
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parents[2] / "migrations"))
    assert ScriptDirectory.from_config(config).get_current_head() == REVISION


def test_the_migrations_make_exactly_the_tables_of_the_models(migrated_file: Path) -> None:
    with open_engine(migrated_file).connect() as connection:
        context = MigrationContext.configure(connection, opts={"render_as_batch": True})
        assert compare_metadata(context, Base.metadata) == []


def test_every_check_of_the_models_is_in_the_database(migrated_file: Path) -> None:
    with sqlite3.connect(migrated_file) as connection:
        made = dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
    for table in Base.metadata.sorted_tables:
        for constraint in table.constraints:
            if isinstance(constraint, CheckConstraint):
                assert f"CHECK ({constraint.sqltext})" in made[table.name]


def test_migrating_again_changes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "new" / "gainline.sqlite3"
    assert not is_current(file)
    migrate(file)
    assert is_current(file)
    before = file.read_bytes()
    migrate(file)
    assert file.read_bytes() == before
    assert revision_of(file) == REVISION


def set_revision(file: Path, revision: str) -> None:
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE alembic_version SET version_num = ?", (revision,))
    connection.close()


def test_start_up_refuses_a_database_without_tables_and_names_the_command(settings: Settings) -> None:
    settings.database_file.unlink()
    with pytest.raises(SchemaError, match="gainline serve"), TestClient(create_app(settings)):
        pass


def test_a_filled_first_database_is_brought_up_to_date_and_its_proposals_computed_again(tmp_path: Path) -> None:
    file = tmp_path / "gainline.sqlite3"
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parents[2] / "migrations"))
    with open_engine(file, foreign_keys=False).connect() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        connection.exec_driver_sql(
            "INSERT INTO vehicle VALUES (1, 'jsbsim', 'Drone', 0, 'ready', '{}', '', '2026-11-20 10:00:00')"
        )
        for number, state in enumerate(("ready", "finished"), start=1):
            connection.exec_driver_sql(
                "INSERT INTO campaign (id, version, name, state, stop_reason, experiment, strategy, definition,"
                " vehicle_id, vehicle_options, created_at, updated_at) VALUES (?, 1, 'A', ?, '', 'takeoff', 'gradient',"
                " '{}', 1, '{}', '2026-11-20 10:00:00', '2026-11-20 10:00:00')",
                (number, state),
            )
        connection.commit()
    told: list[str] = []
    migrate(file, told.append)
    steps = int(REVISION) - 1
    assert told[0] == f"Migrating the database from revision 0001 to {REVISION}"
    assert [line.partition(":")[0] for line in told[1:]] == [f"  {step} of {steps}" for step in range(1, steps + 1)]
    with sqlite3.connect(file) as connection:
        assert connection.execute("SELECT kind, state, campaign_id, done_share FROM job").fetchall() == [
            ("proposal", "queued", 1, None)
        ]
        assert connection.execute("SELECT count(*) FROM campaign").fetchone() == (2,)


def test_what_was_asked_of_a_vehicle_survives_new_kinds_of_commands(migrated_file: Path, tmp_path: Path) -> None:
    file = tmp_path / "gainline.sqlite3"
    file.write_bytes(migrated_file.read_bytes())
    add = (
        "INSERT INTO vehicle_act (id, vehicle_id, kind, state, by, reason, problem, requested_at)"
        " VALUES (?, 1, ?, 'done', 'Ada', '', '', '2026-11-20 10:00:00')"
    )
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parents[2] / "migrations"))
    with open_engine(file, foreign_keys=False).connect() as connection:
        config.attributes["connection"] = connection
        connection.exec_driver_sql(add, (1, "land"))
        connection.exec_driver_sql(add, (2, "abort"))
        command.downgrade(config, "0007")
        kept = connection.exec_driver_sql("SELECT id, kind, by FROM vehicle_act").fetchall()
        command.upgrade(config, "0008")
        connection.exec_driver_sql(add, (3, "take-off"))
        after = connection.exec_driver_sql("SELECT id, kind FROM vehicle_act").fetchall()
        connection.commit()
    assert kept == [(1, "land", "Ada")]
    assert after == [(1, "land"), (3, "take-off")]


def test_flights_survive_the_migration_to_stored_predicted_curves_and_back(
    client: TestClient, database: Database, settings: Settings
) -> None:
    """A campaign with one flight of its proposal and one of custom gains, taken back to 0008 and up again."""
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 9}})
    create_flown_trial(client, database, campaign["id"])
    custom = create_trial(client, campaign["id"], gains={"kp": 350, "ki": 30, "kd": 90}, fly={"speed": None})
    land(database, lift_off(database), create_record(0.9))
    run_jobs(database)
    shown = f"/api/trials/{custom['id']}/figure"
    path = f"/api/campaigns/{campaign['id']}/trials"
    trials = get(client, path)["items"]
    assert "prediction" in roles_of(get(client, shown))
    with database.read() as session:
        curve_id = session.get_one(TrialRow, custom["id"]).predicted_id
        kept = {row.id for row in session.query(TrajectoryRow)} - {curve_id}
    database.close()
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parents[2] / "migrations"))
    with open_engine(settings.database_file, foreign_keys=False).connect() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "0008")
        columns = {row[1] for row in connection.exec_driver_sql("PRAGMA table_info(trial)")}
        assert {row[0] for row in connection.exec_driver_sql("SELECT id FROM trajectory")} == kept
        connection.commit()
    assert "predicted_id" not in columns
    migrate(settings.database_file)
    assert get(client, path)["items"] == trials
    assert "prediction" not in roles_of(get(client, shown))
    with database.read() as session:
        assert {row.id for row in session.query(TrajectoryRow)} == kept


def roles_of(card: Json) -> set[str]:
    return {trace["meta"]["role"] for trace in card["figure"]["data"]}


def test_a_database_of_a_newer_program_is_refused_and_left_alone(settings: Settings) -> None:
    set_revision(settings.database_file, "9999")
    for check in (require_current, migrate):
        with pytest.raises(SchemaError, match="newer Gainline"):
            check(settings.database_file)
    assert not is_current(settings.database_file)
    assert revision_of(settings.database_file) == "9999"


def test_a_file_that_is_no_database_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "gainline.sqlite3"
    file.write_text("Dear Sir or Madam, " * 100)
    with pytest.raises(StorageError, match="is not a Gainline database"):
        migrate(file)


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot be used"):
        migrate(tmp_path / "file" / "gainline.sqlite3")
