"""States of campaigns, trials and their flights, vehicles and their acts, and jobs, with the transitions and actions
that each allows. Stored and sent by their values.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final, Literal


class CampaignState(StrEnum):
    """States of a campaign.

            draft ──→ ready ──→ flying ←──→ deciding ←──→ finished ──→ archived

    draft: its first gains are not computed yet. ready: they are, and nothing has flown; the definition may still
    change. flying: a trial is in the air. deciding: the next gains are being computed, or a review is due. finished:
    converged, out of flights, or stopped by the operator, see `Outcome`; it is reopened by the operator, or, unless
    the operator stopped it, when its stop rule is no longer met by the flights that count.
    """

    DRAFT = "draft"
    READY = "ready"
    FLYING = "flying"
    DECIDING = "deciding"
    FINISHED = "finished"
    ARCHIVED = "archived"


class Outcome(StrEnum):
    """Why a campaign is finished."""

    CONVERGED = "converged"
    BUDGET = "budget"
    STOPPED = "stopped"


CAMPAIGN_TRANSITIONS: Final[Mapping[CampaignState, frozenset[CampaignState]]] = {
    CampaignState.DRAFT: frozenset({CampaignState.READY}),
    CampaignState.READY: frozenset({CampaignState.FLYING}),
    CampaignState.FLYING: frozenset({CampaignState.DECIDING}),
    CampaignState.DECIDING: frozenset({CampaignState.FLYING, CampaignState.FINISHED}),
    CampaignState.FINISHED: frozenset({CampaignState.DECIDING, CampaignState.ARCHIVED}),
    CampaignState.ARCHIVED: frozenset(),
}

_ALL_CAMPAIGN_STATES: Final = frozenset(CampaignState)
_UNFLOWN_CAMPAIGN_STATES: Final = frozenset({CampaignState.DRAFT, CampaignState.READY})

CAMPAIGN_ACTIONS: Final[Mapping[str, frozenset[CampaignState]]] = {
    "rename": _ALL_CAMPAIGN_STATES,
    "define": _UNFLOWN_CAMPAIGN_STATES,
    "delete": _UNFLOWN_CAMPAIGN_STATES,
    "plan": frozenset({CampaignState.READY, CampaignState.DECIDING}),
    "propose": frozenset({CampaignState.DRAFT, CampaignState.READY, CampaignState.DECIDING}),
    "finish": frozenset({CampaignState.DECIDING}),
    "reopen": frozenset({CampaignState.FINISHED}),
    "archive": frozenset({CampaignState.FINISHED}),
    "clone": _ALL_CAMPAIGN_STATES,
    "judge": _ALL_CAMPAIGN_STATES - {CampaignState.ARCHIVED},
}
"""Actions that a person may take on a campaign, and in which states. `define` changes definition or vehicle, `plan`
adds a trial, `judge` classifies a flight or imports the record of a lost one."""


class VehicleState(StrEnum):
    """States of a vehicle.

            disconnected ←→ ready ←→ staged ──→ flying ──→ ready
                  ↑           ↑         └──────────┴──→ quarantined
                  └───────────┴── released by a person ──────┘

    Quarantined: something could not be verified, for instance that the safe gains are restored. The vehicle is grounded
    until a person has inspected it and releases it.
    """

    DISCONNECTED = "disconnected"
    READY = "ready"
    STAGED = "staged"
    FLYING = "flying"
    QUARANTINED = "quarantined"


VEHICLE_TRANSITIONS: Final[Mapping[VehicleState, frozenset[VehicleState]]] = {
    VehicleState.DISCONNECTED: frozenset({VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.READY: frozenset({VehicleState.STAGED, VehicleState.DISCONNECTED, VehicleState.QUARANTINED}),
    VehicleState.STAGED: frozenset({VehicleState.FLYING, VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.FLYING: frozenset({VehicleState.READY, VehicleState.QUARANTINED}),
    VehicleState.QUARANTINED: frozenset({VehicleState.READY, VehicleState.DISCONNECTED}),
}

_DOWN: Final = frozenset({VehicleState.READY, VehicleState.QUARANTINED})
_MAYBE_UP: Final = frozenset({VehicleState.STAGED, VehicleState.FLYING, VehicleState.QUARANTINED})

VEHICLE_ACTIONS: Final[Mapping[str, frozenset[VehicleState]]] = {
    "fly": frozenset({VehicleState.READY}),
    "stage": frozenset({VehicleState.READY}),
    "connect": frozenset({VehicleState.DISCONNECTED}),
    "disconnect": _DOWN | {VehicleState.DISCONNECTED},
    "check": _DOWN,
    "restore": _DOWN,
    "parameters": frozenset({VehicleState.READY}),
    "edit": _DOWN | {VehicleState.DISCONNECTED},
    "configure": frozenset({VehicleState.DISCONNECTED}),
    "delete": frozenset({VehicleState.DISCONNECTED}),
    "land": _MAYBE_UP,
    "motors off": _MAYBE_UP,
    "release": frozenset({VehicleState.QUARANTINED}),
}
"""Actions that a person may take on a vehicle, and in which states. A vehicle that is not registered takes only `fly`
and `release`. `configure` changes its options, `edit` everything else. Disconnecting a vehicle that is not connected
stops reconnecting it."""


class ActKind(StrEnum):
    """Kinds of acts: what a person asked of a registered vehicle, or decided about it. The last four belong to flights,
    which carry them out; the others to the time between flights."""

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
    SETTINGS = "settings"
    STAGE = "stage"
    TAKE_OFF = "take-off"
    UNSTAGE = "unstage"
    ABORT = "abort"


FLIGHT_COMMANDS: Final = frozenset({ActKind.STAGE, ActKind.TAKE_OFF, ActKind.UNSTAGE, ActKind.ABORT})
"""Acts that a flight carries out: their outcome is the flight's."""

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


class JobState(StrEnum):
    """States of numeric work. It is pure, so a job whose worker died is queued again.

    queued ──→ running ──→ done
      ↑  │        ├──────→ failed ───→ queued (retried)
      │  │        ├──────→ cancelled ─→ queued (retried)
      │  └─→ cancelled
      └───────────┘ the worker died or shut down
    """

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


JOB_TRANSITIONS: Final[Mapping[JobState, frozenset[JobState]]] = {
    JobState.QUEUED: frozenset({JobState.RUNNING, JobState.CANCELLED}),
    JobState.RUNNING: frozenset({JobState.DONE, JobState.FAILED, JobState.CANCELLED, JobState.QUEUED}),
    JobState.DONE: frozenset(),
    JobState.FAILED: frozenset({JobState.QUEUED}),
    JobState.CANCELLED: frozenset({JobState.QUEUED}),
}

JOB_ACTIONS: Final[Mapping[str, frozenset[JobState]]] = {
    "cancel": frozenset({JobState.QUEUED, JobState.RUNNING}),
    "retry": frozenset({JobState.FAILED, JobState.CANCELLED}),
}
"""Actions that a person may take on a job, and in which states."""


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
               │            │        └──→ planned (it never left the ground)
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


TRIAL_TRANSITIONS: Final[Mapping[TrialState, frozenset[TrialState]]] = {
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

HISTORY_TRIAL_STATES: Final = frozenset({TrialState.VALID, TrialState.ABORTED})
"""The flights that a proposal is computed from, and that use up the budget."""

UNFLOWN_TRIAL_STATES: Final = frozenset({TrialState.PLANNED, TrialState.STAGED})
"""Trials that may still be flown or cancelled."""

FLOWN_TRIAL_STATES: Final = HISTORY_TRIAL_STATES | {TrialState.CAPTURED, TrialState.INVALID, TrialState.LOST}
"""Trials that have left the ground."""

BUDGETED_TRIAL_STATES: Final = HISTORY_TRIAL_STATES | UNFLOWN_TRIAL_STATES | {TrialState.FLYING, TrialState.CAPTURED}
"""Trials that have used up, or may yet use up, a flight of the budget."""

TRIAL_ACTIONS: Final[Mapping[str, frozenset[TrialState]]] = {
    "fly": frozenset({TrialState.PLANNED}),
    "stage": frozenset({TrialState.PLANNED}),
    "take-off": frozenset({TrialState.STAGED}),
    "unstage": frozenset({TrialState.STAGED}),
    "cancel": UNFLOWN_TRIAL_STATES,
    "abort": frozenset({TrialState.STAGED, TrialState.FLYING}),
    "upload": frozenset({TrialState.PLANNED, TrialState.LOST}),
    "classify": FLOWN_TRIAL_STATES,
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


ACTIVE_FLIGHT_STATES: Final = frozenset({FlightState.REQUESTED, FlightState.RUNNING})
FLOWN_FLIGHT_STATES: Final = frozenset({FlightState.LANDED, FlightState.ABORTED, FlightState.LOST})
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
