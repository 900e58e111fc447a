"""States of a trial, and of the flight that a worker carries out for it."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final, Literal

TrialKind = Literal["start", "step", "shorter step", "repeat", "baseline", "manual"]
"""Where a trial's gains come from: the strategy's first, its next, one of its shorter steps, flown before, those of the
first flight, a person."""

Ending = Literal["completed", "aborted", "invalid"]
"""How a flight's record ends: completely, where the flight was aborted, or with an invalid measurement."""

AbortCause = Literal["limit", "operator", "behaved badly", "something else"]
"""Why a flight was aborted: a limit that the program enforces; the operator, without a reason yet; or the operator's
reason. Unknown for flights from before it was recorded."""

NOT_AGAINST_GAINS: Final[frozenset[AbortCause]] = frozenset({"operator", "something else"})
"""Aborts that do not count against the gains, or not yet. All others do."""

FlightMode = Literal["fly", "stage"]
"""Take off as soon as the gains are read back, or wait for the operator's own act."""


class TrialState(StrEnum):
    """States of one policy that is flown once.

            planned ──→ staged ──→ flying ──→ captured ──→ valid | aborted | invalid
               │  ↑───────┘ │        ├──→ aborted
               │            │        ├──→ lost ──→ captured (record recovered) | invalid
               │            │        └──→ planned (no take-off command was sent)
               ├────────────┴──→ cancelled
               └──→ captured (flown elsewhere, imported)

    valid ↔ invalid and aborted ↔ invalid, with a reason; whatever was computed from the flight is recomputed. staged:
    every gain was written and read back. lost: it is unknown how the flight ended; it is never flown again
    automatically.
    """

    PLANNED = "planned"
    STAGED = "staged"
    FLYING = "flying"
    CAPTURED = "captured"
    VALID = "valid"
    ABORTED = "aborted"
    INVALID = "invalid"
    CANCELLED = "cancelled"
    LOST = "lost"


TRANSITIONS: Final[Mapping[TrialState, frozenset[TrialState]]] = {
    TrialState.PLANNED: frozenset({TrialState.STAGED, TrialState.CANCELLED, TrialState.CAPTURED}),
    TrialState.STAGED: frozenset({TrialState.FLYING, TrialState.PLANNED, TrialState.CANCELLED}),
    TrialState.FLYING: frozenset({TrialState.CAPTURED, TrialState.ABORTED, TrialState.LOST, TrialState.PLANNED}),
    TrialState.CAPTURED: frozenset({TrialState.VALID, TrialState.ABORTED, TrialState.INVALID}),
    TrialState.VALID: frozenset({TrialState.INVALID}),
    TrialState.ABORTED: frozenset({TrialState.INVALID}),
    TrialState.INVALID: frozenset({TrialState.VALID, TrialState.ABORTED}),
    TrialState.CANCELLED: frozenset(),
    TrialState.LOST: frozenset({TrialState.CAPTURED, TrialState.INVALID}),
}

HISTORY: Final = frozenset({TrialState.VALID, TrialState.ABORTED})
"""The flights that a proposal is computed from, and that use up the budget."""

UNFLOWN: Final = frozenset({TrialState.PLANNED, TrialState.STAGED})
"""Trials that may still be flown or cancelled."""

BUDGETED_STATES: Final = HISTORY | UNFLOWN | {TrialState.FLYING, TrialState.CAPTURED}
"""Trials that have used up, or may yet use up, a flight of the budget."""

ACTIONS: Final[Mapping[str, frozenset[TrialState]]] = {
    "fly": frozenset({TrialState.PLANNED}),
    "stage": frozenset({TrialState.PLANNED}),
    "take-off": frozenset({TrialState.STAGED}),
    "unstage": frozenset({TrialState.STAGED}),
    "cancel": UNFLOWN,
    "abort": frozenset({TrialState.STAGED, TrialState.FLYING}),
    "upload": frozenset({TrialState.PLANNED, TrialState.LOST}),
    "classify": frozenset(
        {TrialState.CAPTURED, TrialState.VALID, TrialState.ABORTED, TrialState.INVALID, TrialState.LOST}
    ),
    "judge abort": frozenset({TrialState.ABORTED}),
    "note": frozenset(TrialState),
}
"""Actions that a person may take on a trial, and in which states."""


class FlightState(StrEnum):
    """States of one request to a vehicle: the worker's queue, and the ledger of the gains that the vehicle was given.

    requested ──→ running ──→ landed | aborted | failed | lost | cancelled
        └──→ cancelled
    """

    REQUESTED = "requested"
    RUNNING = "running"
    LANDED = "landed"
    ABORTED = "aborted"
    FAILED = "failed"
    LOST = "lost"
    CANCELLED = "cancelled"


ACTIVE_STATES: Final = frozenset({FlightState.REQUESTED, FlightState.RUNNING})
"""A vehicle has at most one flight in these states."""

FLIGHT_TRANSITIONS: Final[Mapping[FlightState, frozenset[FlightState]]] = {
    FlightState.REQUESTED: frozenset({FlightState.RUNNING, FlightState.CANCELLED}),
    FlightState.RUNNING: frozenset(
        {FlightState.LANDED, FlightState.ABORTED, FlightState.FAILED, FlightState.LOST, FlightState.CANCELLED}
    ),
    FlightState.LANDED: frozenset(),
    FlightState.ABORTED: frozenset(),
    FlightState.FAILED: frozenset(),
    FlightState.LOST: frozenset(),
    FlightState.CANCELLED: frozenset(),
}
