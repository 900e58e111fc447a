"""Data folders that cannot be used: refused by the name of the option, before anything else happens."""

import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from app.common.data_folder import make_private, prepare_data_dir
from app.common.errors import StorageError
from app.processes.locks import exclusive
from tests.runtime.processes import environment


def a_file(tmp_path: Path) -> Path:
    (tmp_path / "data").write_text("not a folder")
    return tmp_path / "data"


def below_a_file(tmp_path: Path) -> Path:
    return a_file(tmp_path) / "inside"


def where_no_folder_can_be(_tmp_path: Path) -> Path:
    return Path("/proc/gainline")


@pytest.mark.parametrize(
    ("command", "make"),
    [
        (("serve", "--port", "0"), a_file),
        pytest.param(("serve", "--port", "0"), below_a_file, marks=pytest.mark.complete),
        pytest.param(("worker",), where_no_folder_can_be, marks=pytest.mark.complete),
    ],
)
def test_a_data_folder_that_cannot_be_used_is_named_with_its_option(
    command: tuple[str, ...], make: Callable[[Path], Path], tmp_path: Path
) -> None:
    folder = make(tmp_path)
    refused = subprocess.run(
        [sys.executable, "-m", "app.cli", *command, "--data-dir", str(folder)],
        env=environment(COLUMNS="1000"),
        capture_output=True,
        text=True,
        check=False,
    )
    said = " ".join(refused.stderr.split())
    assert refused.returncode == 1
    assert f"The folder {folder} cannot be used for Gainline's data." in said
    assert "--data-dir: " in said
    assert "Traceback" not in said


def test_a_missing_data_folder_is_made(tmp_path: Path) -> None:
    prepare_data_dir(tmp_path / "a" / "b")
    prepare_data_dir(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()


def mode_of(folder: Path) -> int:
    return stat.S_IMODE(folder.stat().st_mode)


def test_a_new_data_folder_is_its_users_alone(tmp_path: Path) -> None:
    prepare_data_dir(tmp_path / "data")
    assert mode_of(tmp_path / "data") == 0o700
    assert make_private(tmp_path / "data") == ""


@pytest.mark.parametrize("wide", [0o755, 0o750, 0o701, 0o777])
def test_a_folder_that_others_can_open_is_restricted_and_reported(tmp_path: Path, wide: int) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    folder.chmod(wide)
    assert (
        make_private(folder)
        == f"{folder} was open to other users of this computer (mode {wide:o}); now only you can open it."
    )
    assert mode_of(folder) == 0o700


def test_a_folder_that_stays_open_to_others_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a disk that knows no permissions, or one that belongs to somebody else."""
    folder = tmp_path / "data"
    folder.mkdir()
    folder.chmod(0o755)
    monkeypatch.setattr(Path, "chmod", lambda *_: None)
    with pytest.raises(StorageError, match="Other users of this computer can open") as refused:
        make_private(folder)
    assert [problem.field for problem in refused.value.problems] == ["--data-dir"]


def test_a_lock_that_cannot_be_opened_says_where_it_is(tmp_path: Path) -> None:
    (tmp_path / "server.lock").mkdir()
    with (
        pytest.raises(StorageError, match=r"server\.lock cannot be opened: Is a directory"),
        exclusive(tmp_path / "server.lock"),
    ):
        pass
