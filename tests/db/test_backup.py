"""What is left of a backup whose process is killed in the middle, and who deletes it."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.common.settings import Settings
from app.db.backup import discard_partial_copies, take_backup
from app.db.session import Database

HANGING = """
import sys, time
from pathlib import Path
from app.db.backup import take_backup

def verify(copied):
    print(copied, flush=True)
    time.sleep(60)

take_backup(Path(sys.argv[1]), verify)
"""


class Copying(subprocess.Popen[str]):
    """A process that copies the database, and verifies the copy until it is killed."""

    def __init__(self, database_file: Path) -> None:
        super().__init__([sys.executable, "-c", HANGING, str(database_file)], text=True, stdout=subprocess.PIPE)

    def copied(self) -> Path:
        """The copy, once it is being verified."""
        assert self.stdout is not None
        return Path(self.stdout.readline().strip())


@pytest.mark.complete
def test_copies_of_killed_backups_are_deleted_but_never_one_that_is_being_made(
    database: Database, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = settings.data_dir / "backup-20161128" / "gainline.sqlite3"
    own.parent.mkdir()
    own.touch()
    with Copying(database.file) as killed, Copying(database.file) as other:
        copies = [killed.copied(), other.copied()]
        killed.kill()
        killed.wait()
        assert copies[0].is_file(), "a killed process cannot delete it"
        discard_partial_copies(settings.data_dir)
        take_backup(database.file, lambda _: None).close()
        assert copies[1].is_file(), "another process is still making it"
        other.kill()
        other.wait()
    free: list[bool] = []
    monkeypatch.setattr("app.db.backup._require_room", lambda _file: free.append(not any(map(Path.exists, copies))))
    take_backup(database.file, lambda _: None).close()
    assert free == [True], "the next backup deletes them, before it looks for room"
    assert [left.name for left in settings.data_dir.glob("*copy*")] == []
    assert own.is_file(), "a person's own folder"
