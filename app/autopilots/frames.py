"""What kind of vehicle a recording is of, by what its autopilot tells."""

from collections.abc import Callable, Mapping
from typing import Final

from app.autopilots.ardupilot import logged_flight as ardupilot
from app.autopilots.px4 import logged_flight as px4
from app.autopilots.recording import Recording

_OTHER: Final[Mapping[str, Callable[[Recording], str]]] = {"ardupilot": ardupilot.frame_of, "px4": px4.frame_of}
"""What tells a vehicle that is no copter with several rotors, by its autopilot."""


def frame_of(recording: Recording) -> str:
    """The vehicle's frame, one of `OTHER_FRAMES` if it is no copter with several rotors; empty if not known."""
    other = _OTHER.get(recording.autopilot.name)
    return (other(recording) if other else "") or recording.frame
