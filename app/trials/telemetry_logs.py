"""Where the telemetry log of a flight lies."""

from pathlib import Path


def telemetry_log(data_dir: Path, flight_id: int) -> Path:
    """The .tlog that the flight's vehicle writes, if it keeps one."""
    return data_dir / "tlogs" / f"flight-{flight_id}.tlog"


def log_of_trial(data_dir: Path, trial_id: int) -> Path:
    """The .tlog that came in with a trial that was flown elsewhere, if one did."""
    return data_dir / "tlogs" / f"trial-{trial_id}.tlog"
