"""States of a campaign."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class CampaignState(StrEnum):
    """States of a campaign.

            draft ──→ ready ──→ flying ←──→ deciding ──→ finished ──→ archived

    draft: its first gains are not computed yet. ready: they are, and nothing has flown; the definition may still
    change. flying: a trial is in the air. deciding: the next gains are being computed, or a review is due. finished:
    converged, out of flights, or stopped by the operator; see `Outcome`.
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


TRANSITIONS: Final[Mapping[CampaignState, frozenset[CampaignState]]] = {
    CampaignState.DRAFT: frozenset({CampaignState.READY}),
    CampaignState.READY: frozenset({CampaignState.FLYING}),
    CampaignState.FLYING: frozenset({CampaignState.DECIDING}),
    CampaignState.DECIDING: frozenset({CampaignState.FLYING, CampaignState.FINISHED}),
    CampaignState.FINISHED: frozenset({CampaignState.ARCHIVED}),
    CampaignState.ARCHIVED: frozenset(),
}

_ALL: Final = frozenset(CampaignState)
_UNFLOWN: Final = frozenset({CampaignState.DRAFT, CampaignState.READY})

ACTIONS: Final[Mapping[str, frozenset[CampaignState]]] = {
    "rename": _ALL,
    "define": _UNFLOWN,
    "delete": _UNFLOWN,
    "plan": frozenset({CampaignState.READY, CampaignState.DECIDING}),
    "propose": frozenset({CampaignState.DRAFT, CampaignState.READY, CampaignState.DECIDING}),
    "finish": frozenset({CampaignState.DECIDING}),
    "archive": frozenset({CampaignState.FINISHED}),
    "clone": _ALL,
    "judge": _ALL - {CampaignState.ARCHIVED},
}
"""Actions that a person may take on a campaign, and in which states. `define` changes definition or vehicle, `plan`
adds a trial, `judge` classifies a flight or imports the record of a lost one."""
