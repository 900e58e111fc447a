"""States of a vehicle, and of its acts: requests beside its flights."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class VehicleState(StrEnum):
    """States of a vehicle.

            disconnected ←→ ready ←→ staged ──→ flying ──→ ready
                  ↑           ↑         └──────────┴──→ quarantined
                  └───────────┴── released by a person ──────┘

    Quarantined: something could not be verified, for instance that the safe gains are restored. The vehicle is grounded
    until a person has looked at it and releases it.
    """

    DISCONNECTED = "disconnected"
    READY = "ready"
    STAGED = "staged"
    FLYING = "flying"
    QUARANTINED = "quarantined"


TRANSITIONS: Final[Mapping[VehicleState, frozenset[VehicleState]]] = {
    VehicleState.DISCONNECTED: frozenset({VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.READY: frozenset({VehicleState.STAGED, VehicleState.DISCONNECTED, VehicleState.QUARANTINED}),
    VehicleState.STAGED: frozenset({VehicleState.FLYING, VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.FLYING: frozenset({VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.QUARANTINED: frozenset({VehicleState.READY, VehicleState.DISCONNECTED}),
}

_DOWN: Final = frozenset({VehicleState.READY, VehicleState.QUARANTINED})
_MAYBE_UP: Final = frozenset({VehicleState.STAGED, VehicleState.FLYING, VehicleState.QUARANTINED})

ACTIONS: Final[Mapping[str, frozenset[VehicleState]]] = {
    "fly": frozenset({VehicleState.READY}),
    "stage": frozenset({VehicleState.READY}),
    "connect": frozenset({VehicleState.DISCONNECTED}),
    "disconnect": _DOWN | {VehicleState.DISCONNECTED},
    "check": _DOWN,
    "restore": _DOWN,
    "parameters": frozenset({VehicleState.READY}),
    "edit": _DOWN | {VehicleState.DISCONNECTED},
    "land": _MAYBE_UP,
    "motors off": _MAYBE_UP,
    "release": frozenset({VehicleState.QUARANTINED}),
}
"""Actions that a person may take on a vehicle, and in which states. A vehicle that is not registered takes only `fly`
and `release`. To disconnect a vehicle that is not connected is to stop looking for it."""


class ActKind(StrEnum):
    """Kinds of acts: requests to a registered vehicle and decisions about it, beside its flights."""

    CONNECT = "connect"
    DISCONNECT = "disconnect"
    CHECK = "check"
    RESTORE = "restore"
    PARAMETERS = "parameters"
    RELEASE = "release"
    LAND = "land"
    MOTORS_OFF = "motors off"
    SAFE_GAINS = "safe gains"
    CONTROL = "control"


GIVES_GAINS: Final = frozenset({ActKind.CONNECT, ActKind.RESTORE, ActKind.RELEASE})
"""Acts that write the safe gains to the vehicle and so belong in its ledger. A first connection only compares the
gains; it is in the ledger if the vehicle was found with its safe gains."""


class ActState(StrEnum):
    """States of an act.

    requested ──→ running ──→ done | failed
        └──→ failed
    """

    REQUESTED = "requested"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"


ACTIVE_ACT_STATES: Final = frozenset({ActState.REQUESTED, ActState.RUNNING})
"""A vehicle has at most one act in these states."""

ACT_TRANSITIONS: Final[Mapping[ActState, frozenset[ActState]]] = {
    ActState.REQUESTED: frozenset({ActState.RUNNING, ActState.FAILED}),
    ActState.RUNNING: frozenset({ActState.DONE, ActState.FAILED}),
    ActState.DONE: frozenset(),
    ActState.FAILED: frozenset(),
}
