"""The states of one trial on a MAVLink vehicle, and the moves between them."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class State(StrEnum):
    """One trial, from the first heartbeat to the safe gains read back.

        connect → preflight → set gains → arm → take-off → record → land ──→ disarm → restore → idle
           ↓                               │       │          ├──→ abort-land ─↗↘
        observing                          │       │          └──→ link lost ──→ quarantined
                                           └───────┴──→ disarm

    A failure before arming leads back to idle. From arm on every end leads through disarm and restore, or into
    quarantine, where nothing but a person helps. Stopping the motors leads to disarm from every state. A vehicle that
    was met armed, or armed by somebody else, is only observed.
    """

    IDLE = "idle"
    CONNECT = "connect"
    PREFLIGHT = "preflight"
    SET_GAINS = "set gains"
    ARM = "arm"
    TAKEOFF = "take-off"
    RECORD = "record"
    LAND = "land"
    ABORT_LAND = "abort-land"
    LINK_LOST = "link lost"
    DISARM = "disarm"
    RESTORE = "restore"
    QUARANTINE = "quarantined"
    OBSERVE = "observing"


TRANSITIONS: Final[Mapping[State, frozenset[State]]] = {
    State.IDLE: frozenset({State.CONNECT, State.SET_GAINS, State.OBSERVE}),
    State.CONNECT: frozenset({State.PREFLIGHT, State.IDLE, State.OBSERVE}),
    State.PREFLIGHT: frozenset({State.SET_GAINS, State.IDLE, State.QUARANTINE, State.OBSERVE}),
    State.SET_GAINS: frozenset({State.ARM, State.IDLE, State.QUARANTINE, State.OBSERVE}),
    State.ARM: frozenset({State.TAKEOFF, State.ABORT_LAND, State.DISARM, State.QUARANTINE}),
    State.TAKEOFF: frozenset({State.RECORD, State.ABORT_LAND, State.LINK_LOST, State.DISARM, State.QUARANTINE}),
    State.RECORD: frozenset({State.LAND, State.ABORT_LAND, State.LINK_LOST, State.DISARM, State.QUARANTINE}),
    State.LAND: frozenset({State.DISARM, State.ABORT_LAND, State.QUARANTINE}),
    State.ABORT_LAND: frozenset({State.DISARM, State.QUARANTINE}),
    State.LINK_LOST: frozenset({State.ABORT_LAND, State.DISARM, State.QUARANTINE}),
    State.DISARM: frozenset({State.RESTORE, State.ABORT_LAND, State.QUARANTINE}),
    State.RESTORE: frozenset({State.IDLE, State.QUARANTINE}),
    State.QUARANTINE: frozenset({State.IDLE}),
    State.OBSERVE: frozenset({State.IDLE}),
}
"""From quarantine and observing a person leads on, nobody else. Disarm goes back to abort-land when the vehicle is
found in the air; what ends in idle from arm on has been disarmed and has its safe gains back."""

COMMANDED: Final = frozenset({State.ARM, State.TAKEOFF, State.RECORD, State.LAND, State.ABORT_LAND})
"""An operator's abort has a meaning in these."""

LANDING: Final = frozenset({State.LAND, State.ABORT_LAND})
"""It has been told to land, and is heard."""

OVER: Final = frozenset({State.IDLE, State.QUARANTINE})
QUARANTINE_STATES: Final = frozenset({State.QUARANTINE, State.OBSERVE})
"""Nothing that changes the vehicle may be sent but Land and motors off, until a person has released it."""
