"""The gains that may be flown instead of a proposal's: a smaller step, the best gains again, the first ones again."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from app.autopilots.registry import space_of
from app.campaigns import history, proposals
from app.campaigns.definitions import definition_of
from app.campaigns.schemas import ChoiceKind, Variant
from app.campaigns.statistics import standing_within_bounds_of
from app.common.errors import ConflictError
from app.core.policy import Gains
from app.db.models import CampaignRow, ProposalRow, TrialRow

_KINDS: Final[Mapping[str, ChoiceKind]] = {
    "start": "baseline",
    "step": "step",
    "shorter step": "step",
    "repeat": "repeat",
    "baseline": "baseline",
}
_ORDER: Final[tuple[ChoiceKind, ...]] = ("step", "smaller step", "repeat", "baseline")


def gains_of(session: Session, campaign: CampaignRow, variant: Variant) -> dict[str, float]:
    """Gains of a variant.

    `repeat`: the best gains by all their flights; `baseline`: the first flight's; `smaller step`: half way from the
    best to the present proposal. Like the advice, it ignores flights outside the campaign's bounds. Raises
    ConflictError before the first valid flight inside the bounds, and where half a step rounds to none.
    """
    trials = history.trials_of(session, campaign.id)
    proposed = proposals.require_fresh_proposal(session, campaign).gains if variant == "smaller step" else None
    found = _variants(campaign, trials, proposed)
    if not found:
        raise ConflictError(
            f"A {variant} needs a valid flight inside the bounds; campaign {campaign.id} has none yet.",
            hint="Fly the first proposal.",
        )
    if variant not in found:
        raise ConflictError(
            "The proposed step cannot be made smaller: half of it is less than one count.",
            hint="Fly the proposal, or repeat the best gains.",
        )
    return found[variant]


def choices_of(
    campaign: CampaignRow, proposal: ProposalRow, trials: Sequence[TrialRow]
) -> dict[ChoiceKind, dict[str, float]]:
    """The gain sets that the next flight may use, each once, in a fixed order; the proposal's are among them."""
    variants = _variants(campaign, trials, proposal.gains)
    own = _kind_of(proposal, variants)
    others: dict[ChoiceKind, dict[str, float]] = {
        kind: gains
        for kind, gains in variants.items()
        if kind != own and gains != proposal.gains and (kind != "smaller step" or own == "step")
    }
    if others.get("baseline") == variants.get("repeat"):
        others.pop("baseline", None)
    found: dict[ChoiceKind, dict[str, float]] = {own: dict(proposal.gains), **others}
    return {kind: found[kind] for kind in _ORDER if kind in found}


def _kind_of(proposal: ProposalRow, variants: Mapping[Variant, Gains]) -> ChoiceKind:
    """What the proposed gains are; those of kind `none` and `manual` were flown, unless the bounds have moved them."""
    flown: tuple[Variant, ...] = ("repeat", "baseline")
    again: list[ChoiceKind] = [kind for kind in flown if variants.get(kind) == proposal.gains]
    return _KINDS.get(proposal.kind, again[0] if again else "step")


def _variants(
    campaign: CampaignRow, trials: Sequence[TrialRow], proposed: Gains | None
) -> dict[Variant, dict[str, float]]:
    """Every variant that there is; none before the first valid flight inside the bounds."""
    now = standing_within_bounds_of(campaign, trials)
    if now is None:
        return {}
    best = dict(now.winner.gains)
    found: dict[Variant, dict[str, float]] = {"repeat": best, "baseline": dict(now.baseline.gains)}
    if proposed is not None:
        space = space_of(definition_of(campaign))
        target = space.vector(proposed)
        half = space.mapping(space.nearest((space.vector(best) + target) / 2.0))
        if half != best and not np.array_equal(space.vector(half), target):
            found["smaller step"] = half
    return found
