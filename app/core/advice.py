"""The recommended next action, shown beside the strategy's proposal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from app.core.confirming import Confirmation, compare_winner, confirm, standing_within_bounds
from app.core.definition import Definition, Flight
from app.core.experiments.base import Experiment
from app.core.stopping import StopVerdict
from app.core.strategies.base import Kind, Proposal

AdviceKind = Literal["step", "repeat", "baseline", "stop"]

_MANUAL_KINDS: dict[Kind, AdviceKind] = {"start": "baseline", "repeat": "repeat", "baseline": "baseline"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """What to do next, with which gains, and why. Kind `baseline` is the first flight, or a repeat with its gains."""

    kind: AdviceKind
    gains: dict[str, float]
    why: str


def advise(
    definition: Definition,
    experiment: Experiment,
    flights: Sequence[Flight],
    proposal: Proposal,
    said: StopVerdict,
) -> Advice:
    """Recommend the next action.

    Under the stop rule `noise` the proposal already contains the recommendation. Under the other rules the advice is
    only a recommendation: it advises against a step whose effect flights cannot distinguish from noise. Only gains
    within the bounds are recommended, except when one of the other rules stops the campaign: that advice names the best
    of all flights.
    """
    tells_noise = definition.stop.kind == "noise"
    now = (compare_winner if said.stop and not tells_noise else standing_within_bounds)(definition, experiment, flights)
    if said.stop:
        return Advice(kind="stop", gains=proposal.gains if now is None else dict(now.winner.gains), why=said.why)
    if now is None or tells_noise:
        kind = _MANUAL_KINDS.get(proposal.kind, "step")
        return Advice(kind=kind, gains=proposal.gains, why=proposal.explanation.summary)
    confirmation = confirm(definition, experiment, flights, proposal)
    kind = _kind(confirmation)
    chosen = {"step": proposal.gains, "repeat": now.winner.gains, "baseline": now.baseline.gains}
    return Advice(kind=kind, gains=dict(chosen.get(kind, now.winner.gains)), why=confirmation.why)


def _kind(confirmation: Confirmation) -> AdviceKind:
    return "stop" if confirmation.phase == "decided" else confirmation.phase
