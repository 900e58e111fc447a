"""Data folders that cannot be used: refused by the name of the option, before anything else happens."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from app.data_dir import prepare_data_dir
from app.errors import StorageError
from app.locks import exclusive
from tests.runtime.processes import PATIENCE_S, environment


def a_file(tmp_path: Path) -> Path:
    (tmp_path / "data").write_text("not a folder")
    return tmp_path / "data"


def below_a_file(tmp_path: Path) -> Path:
    return a_file(tmp_path) / "inside"


def where_no_folder_can_be(_tmp_path: Path) -> Path:
    return Path("/proc/gainline")


@pytest.mark.parametrize("make", [a_file, below_a_file, where_no_folder_can_be])
@pytest.mark.parametrize("command", [("serve", "--port", "0"), ("worker",)])
def test_a_data_folder_that_cannot_be_used_is_named_with_its_option(
    command: tuple[str, ...], make: Callable[[Path], Path], tmp_path: Path
) -> None:
    folder = make(tmp_path)
    refused = subprocess.run(
        [sys.executable, "-m", "app.cli", *command, "--data-dir", str(folder)],
        env=environment(COLUMNS="1000"),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
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


def test_a_lock_that_cannot_be_opened_says_where_it_is(tmp_path: Path) -> None:
    (tmp_path / "server.lock").mkdir()
    with (
        pytest.raises(StorageError, match=r"server\.lock cannot be opened: Is a directory"),
        exclusive(tmp_path / "server.lock"),
    ):
        pass
