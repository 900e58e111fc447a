"""From a campaign's frozen definition and its flights to the next gain set: a pure function."""

from collections.abc import Sequence

from app.core.definition import Definition, Flight
from app.core.experiments import get_experiment
from app.core.experiments.base import Experiment
from app.core.policy import PolicySpace
from app.core.starting import start_gains
from app.core.strategies import STRATEGIES
from app.core.strategies.base import Explanation, Proposal
from app.core.strategies.bias import nominal
from app.core.strategies.history import describe

_ORIGIN = {
    "default": "the experiment's default gains",
    "simplex": "the nominal model's optimum, found by Nelder–Mead from the default gains",
    "given": "the gains given in the campaign's definition",
}


def next_proposal(definition: Definition, flights: Sequence[Flight]) -> Proposal:
    """The same definition and flights give the same proposal, bit for bit on one machine.

    `definition` must be free of problems (`app.core.checking`). Flights are the valid and aborted ones, in their order;
    their trajectories count as stored, in single precision. Without a valid flight the start gains are proposed.
    """
    experiment = get_experiment(definition.experiment)
    space = experiment.space.narrowed(definition.bounds)
    if not any(flight.outcome == "valid" for flight in flights):
        return _start(definition, experiment, space)
    return STRATEGIES[definition.strategy].propose(definition, experiment, space, flights)


def _start(definition: Definition, experiment: Experiment, space: PolicySpace) -> Proposal:
    gains = start_gains(definition, experiment, space)
    trajectory, error = nominal(experiment).predict(space.vector(gains))
    summary = (
        f"The first flight uses {_ORIGIN[definition.start.kind]} ({describe(gains)}); the nominal model, not yet "
        f"corrected by any flight, predicts {error:.4f} {experiment.error_unit}."
    )
    return Proposal(
        kind="start", gains=gains, predicted=trajectory, predicted_error=error, explanation=Explanation(summary=summary)
    )
