"""The prediction that a flight of a proposal carries, as a campaign stores it."""

from app.core.definition import Prediction
from app.core.tuning.strategy import Proposal


def prediction_of(proposal: Proposal) -> Prediction | None:
    """The prediction stored with a flight of the proposal, for later comparison."""
    error = proposal.predicted_error
    return None if error is None else Prediction(error=error, interval=proposal.interval)
