"""Gains relative to the flights so far: a smaller step, the best again, the first again."""

from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from app.campaigns import proposing
from app.campaigns.definitions import definition_of
from app.campaigns.statistics import standing_within_bounds_of
from app.common.errors import ConflictError
from app.common.states import TrialKind
from app.db.models import CampaignRow
from app.trials import history
from app.trials.schemas import Variant

KINDS: Final[dict[Variant, TrialKind]] = {"smaller step": "shorter step", "repeat": "repeat", "baseline": "baseline"}


def gains_of(session: Session, campaign: CampaignRow, variant: Variant) -> dict[str, float]:
    """Gains of a variant.

    `repeat`: the best gains by all their flights; `baseline`: the first flight's; `smaller step`: half way from the
    best to the present proposal. Like the advice, it ignores flights outside the campaign's bounds. Raises
    ConflictError before the first valid flight inside the bounds, and where half a step rounds to none.
    """
    now = standing_within_bounds_of(campaign, history.trials_of(session, campaign.id))
    if now is None:
        raise ConflictError(
            f"Campaign {campaign.id} has no valid flight inside its bounds yet for a {variant} to be measured from.",
            hint="Fly the first proposal.",
        )
    if variant == "baseline":
        return dict(now.baseline.gains)
    best = dict(now.winner.gains)
    if variant == "repeat":
        return best
    space = proposing.space_of(definition_of(campaign))
    proposed = space.vector(proposing.require_fresh_proposal(session, campaign).gains)
    half = space.mapping(space.nearest((space.vector(best) + proposed) / 2.0))
    if half == best or np.array_equal(space.vector(half), proposed):
        raise ConflictError(
            "The proposed step cannot be made smaller: half of it is no whole count.",
            hint="Fly the proposal, or repeat the best gains.",
        )
    return half
