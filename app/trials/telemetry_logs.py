"""Where the telemetry log of a flight lies."""

from pathlib import Path


def telemetry_log(data_dir: Path, flight_id: int) -> Path:
    """The .tlog that the flight's vehicle writes, if it keeps one."""
    return data_dir / "tlogs" / f"flight-{flight_id}.tlog"
