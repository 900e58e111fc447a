"""Process ids of the processes that fly."""

from app.flights.flight_process import FlightProcess


def pid_of(process: FlightProcess) -> int:
    """The id of a started process."""
    pid = process._child._process.pid
    assert pid is not None
    return pid
