"""Paths of flights' telemetry logs."""

from pathlib import Path


def telemetry_log(data_dir: Path, flight_id: int) -> Path:
    """Path of the .tlog that the flight's vehicle writes, if it keeps one."""
    return data_dir / "tlogs" / f"flight-{flight_id}.tlog"


def log_of_trial(data_dir: Path, trial_id: int) -> Path:
    """Path of the .tlog imported with a trial that was flown elsewhere, if there is one."""
    return data_dir / "tlogs" / f"trial-{trial_id}.tlog"
