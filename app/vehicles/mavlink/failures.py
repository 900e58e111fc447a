"""Failures of a trial: reaction and outcome of each. Their conditions are described in
docs/real-flight.md.

The table is ordered by severity: of several failures the first one counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from app.vehicles.flight_end import Failure, StopRequest

__all__ = ["Failure"]

Outcome = Literal["refused", "aborted", "invalid", "quarantine"]
"""refused: nothing flew. aborted: a safety limit was exceeded, which counts against the gains. invalid: the measurement
is unusable. quarantine: as invalid, and the vehicle's state is uncertain."""

Reaction = Literal["none", "restore gains", "disarm", "land, gains first", "land", "repeat land", "cease", "note"]
"""none: there is nothing to undo. restore gains: write the safe gains. disarm: stop the motors, or abort if it may have
left the ground. land, gains first: send the safe gains before Land, because those in flight are suspect. land: send
Land at once. repeat land: send Land until the vehicle is received again. cease: send nothing more. note: send nothing
for it alone."""


@dataclass(frozen=True, slots=True)
class Response:
    """Response to a failure; `reaction` is the immediate action."""

    reaction: Reaction
    outcome: Outcome


RESPONSES: Final[Mapping[Failure, Response]] = {
    Failure.NO_HEARTBEAT: Response("none", "refused"),
    Failure.PARAMETER: Response("restore gains", "refused"),
    Failure.NOT_ARMED: Response("disarm", "refused"),
    Failure.NO_LIFT_OFF: Response("disarm", "aborted"),
    Failure.TAKE_OFF_REFUSED: Response("disarm", "refused"),
    Failure.LINK: Response("repeat land", "invalid"),
    Failure.ENVELOPE: Response("land, gains first", "aborted"),
    Failure.BATTERY: Response("land", "invalid"),
    Failure.OPERATOR: Response("land, gains first", "aborted"),
    Failure.FROZEN: Response("land", "invalid"),
    Failure.GLITCHES: Response("note", "invalid"),
    Failure.DISAGREEMENT: Response("land", "invalid"),
    Failure.LOST_POSITION: Response("land", "invalid"),
    Failure.SLOW_CLOCK: Response("land", "invalid"),
    Failure.TAKEN_OVER: Response("cease", "quarantine"),
    Failure.UNEXPECTED: Response("land", "quarantine"),
    Failure.INTERRUPTED: Response("note", "invalid"),
    Failure.OWN_LANDING: Response("land", "invalid"),
    Failure.DUPLICATE: Response("land", "quarantine"),
    Failure.FALL: Response("note", "quarantine"),
    Failure.SET_POINT: Response("land", "invalid"),
    # It may ring, and would land for seconds on these gains; but it may also drift, or be moved by its estimator or
    # the wind: this does not count against the gains, unless it exceeds a limit.
    Failure.NOT_SETTLED: Response("land, gains first", "invalid"),
    Failure.PAUSED: Response("land", "invalid"),
}


HELP: Final = "fly it manually, or stop its motors"
"""What the operator can still do if a vehicle does not respond to Land."""
NOT_DESCENDING: Final = f"It was commanded to land but was not seen to descend: {HELP}."


@dataclass(frozen=True, slots=True)
class Finding:
    """A detected failure with its explanation, or the request of a person."""

    failure: Failure
    why: str = ""
    request: StopRequest | None = None


CONFIRMATION_PERIODS: Final = 1.05
"""Heartbeat periods between two heartbeats that confirm each other: a contradicting one would arrive between them."""
HEARTBEATS_MISSED: Final = 3.5
"""Heartbeat periods without a heartbeat after which the vehicle counts as lost."""
GROUND_M: Final = 0.15
"""Height below which a vehicle may be standing on the ground."""
DRIFT_M: Final = 1.0
"""Greatest drift of an altitude during a flight."""
REPEAT_S: Final = 1.0
"""Interval at which a command is repeated until the vehicle responds."""
_LAND_REPEATED_S: Final = 5.0
"""Time for which Land is repeated every `REPEAT_S`."""
NOT_DESCENDING_AFTER_S: Final = 5.0
"""Time after the command to land after which a vehicle that does not descend is reported."""
DESCENDING_M_S: Final = -0.2
"""A vehicle that descends faster than this is landing."""


def land_every_s(elapsed_s: float, land_again_s: float) -> float:
    """Return the interval at which Land is repeated, s, `elapsed_s` after the first command. After some seconds it is
    `land_again_s`, because on some autopilots every command restarts the landing, which would then never end."""
    return REPEAT_S if elapsed_s < _LAND_REPEATED_S else land_again_s
