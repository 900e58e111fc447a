"""The data folder: created if missing, with a clear error if it cannot be used. Paths of the telemetry logs in it."""

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.common.errors import Problem, StorageError

OTHERS: Final = 0o077


def prepare_data_dir(folder: Path) -> None:
    """Create the data folder, or one inside it, and verify that this user may write there.

    Raises StorageError that names the option when the folder cannot be used.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "this user cannot write there")
    except OSError as error:
        raise StorageError(
            f"The folder {folder} cannot be used for Gainline's data.",
            problems=(Problem("--data-dir", f"{error.strerror or error}"),),
            hint="Choose a folder that this user can write to, with --data-dir or GAINLINE_DATA_DIR.",
        ) from error


def trial_parameters_folder(data_dir: Path) -> Path:
    """Folder for the parameters that trials have changed on vehicles besides their gains, until they are restored."""
    return data_dir / "trial-parameters"


def make_private(folder: Path) -> str:
    """Remove all other users' access to the data folder, which holds the worker's socket and the secret by which a
    browser commands real vehicles.

    Returns a sentence if that changed something, else an empty string. Raises StorageError when the folder stays open
    to others.
    """
    before = stat.S_IMODE(folder.stat().st_mode)
    if not before & OTHERS:
        return ""
    with suppress(OSError):
        folder.chmod(before & ~OTHERS)
    status = folder.stat()
    if stat.S_IMODE(status.st_mode) & OTHERS:
        raise StorageError(
            f"Other users of this computer can open {folder}, and its mode cannot be changed.",
            problems=(Problem("--data-dir", f"has the mode {stat.S_IMODE(status.st_mode):o}"),),
            hint="Gainline stores the secret there that lets a browser command real vehicles. Choose a private "
            "folder, on a disk with file permissions, with --data-dir or GAINLINE_DATA_DIR.",
        )
    return f"{folder} was open to other users of this computer (mode {before:o}); now only you can open it."


def folder_bytes(folder: Path) -> int:
    """Total size of the files in a folder, bytes; files deleted meanwhile are not counted."""
    total = 0
    for path, _, names in os.walk(folder):
        for name in names:
            with suppress(FileNotFoundError):
                total += os.lstat(Path(path) / name).st_size
    return total


def telemetry_log(data_dir: Path, flight_id: int) -> Path:
    """Path of the .tlog that the flight's vehicle writes, if it keeps one."""
    return data_dir / "tlogs" / f"flight-{flight_id}.tlog"


def log_of_trial(data_dir: Path, trial_id: int) -> Path:
    """Path of the .tlog imported with a trial that was flown elsewhere, if there is one."""
    return data_dir / "tlogs" / f"trial-{trial_id}.tlog"


def vehicle_lock(data_dir: Path, vehicle: int | str) -> Path:
    """Held by the process that has the vehicle: by id where it is registered one by one, else by kind."""
    return data_dir / f"vehicle-{vehicle}.lock"
