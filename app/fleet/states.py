"""The states of a vehicle."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class VehicleState(StrEnum):
    """What may be asked of a vehicle.

        disconnected ←→ ready ←→ staged ──→ flying ──→ ready
              ↑           ↑         └──────────┴──→ quarantined
              └───────────┴── released by a person ──────┘

    Quarantined: something could not be verified, for instance that the safe gains are back. It flies nothing until a
    person has looked at it and releases it.
    """

    DISCONNECTED = "disconnected"
    READY = "ready"
    STAGED = "staged"
    FLYING = "flying"
    QUARANTINED = "quarantined"


MOVES: Final[Mapping[VehicleState, frozenset[VehicleState]]] = {
    VehicleState.DISCONNECTED: frozenset({VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.READY: frozenset({VehicleState.STAGED, VehicleState.DISCONNECTED, VehicleState.QUARANTINED}),
    VehicleState.STAGED: frozenset({VehicleState.FLYING, VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.FLYING: frozenset({VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.QUARANTINED: frozenset({VehicleState.READY, VehicleState.DISCONNECTED}),
}

ACTIONS: Final[Mapping[str, frozenset[VehicleState]]] = {
    "fly": frozenset({VehicleState.READY}),
    "release": frozenset({VehicleState.QUARANTINED}),
}
"""What a person may do with a vehicle, and in which states."""
