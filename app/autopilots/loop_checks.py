"""Comparison of a recorded vertical loop with the replica of its autopilot, for the command line and the web page.

The recording is the log of a flight, or a trace with a row for every step.
"""

from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final

from app.autopilots.ardupilot import loop_check as ardupilot
from app.autopilots.ardupilot.profile import ARDUPILOT
from app.autopilots.autopilot import Autopilot
from app.autopilots.loop_check import LoopCheck, Result, Upload
from app.autopilots.paparazzi import loop_check as paparazzi
from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.px4 import loop_check as px4
from app.autopilots.px4.profile import PX4
from app.core.errors import InputError, Problem
from app.logs.formats import head_of, recognise

CHECKS: Final[Mapping[Autopilot, LoopCheck]] = MappingProxyType(
    {ARDUPILOT: ardupilot.CHECK, PX4: px4.CHECK, PAPARAZZI: paparazzi.CHECK}
)
"""Every autopilot with a replica. The first one that recognises a recording examines it; Paparazzi, to which any
gzipped file may belong, is last."""


def examine(
    stream: BinaryIO, *, name: str, companion: BinaryIO | None = None, given: Mapping[str, float] | None = None
) -> Result:
    """Check a log or a trace, whichever the content is. Raises InputError that names what cannot be read."""
    head = head_of(stream)
    upload = Upload(stream=stream, name=name, companion=companion, given=given)
    if (autopilot := _recognised(head)) is not None:
        check = CHECKS[autopilot]
        examined = check.examine_log(upload) if recognise(head) is check.log else check.examine_trace(upload)
        return replace(examined, autopilot=autopilot.name)
    reason = "contains no signals of a control loop that Gainline has a replica of" if head else "is empty"
    raise InputError(
        f"{name} is not a recording of the vertical loop.",
        hint=f"Use {'; '.join(each.recordings for each in CHECKS.values())}.",
        problems=(Problem("file", reason),),
    )


def autopilot_of(stream: BinaryIO) -> Autopilot | None:
    """The autopilot whose recording this is; None if it is of none."""
    return _recognised(head_of(stream))


def examine_content(content: bytes, *, name: str, companion: bytes | None, gains: str | None) -> Result:
    """Check a recording that is in memory, for a process of its own. Raises InputError as `examine` does, and for
    `gains` that are not KP,KI,KD."""
    given = None if gains is None else paparazzi.parse_gains(gains)
    beside = None if companion is None else BytesIO(companion)
    return examine(BytesIO(content), name=name, companion=beside, given=given)


def examine_file(path: Path) -> Result:
    """Check a recording. Raises InputError as `examine` does, and if it cannot be opened."""
    try:
        with path.open("rb") as stream:
            return examine(stream, name=path.name)
    except OSError as error:
        raise InputError(
            f"{path} could not be read: {error.strerror or error}.", hint="Give a readable recording of the loop."
        ) from error


def _recognised(head: bytes) -> Autopilot | None:
    """The autopilot whose log, or a trace of whose loop, begins so."""
    log = recognise(head)
    return next((each for each, check in CHECKS.items() if log is check.log or check.is_trace(head)), None)
