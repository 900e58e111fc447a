"""The prediction that a flight of a proposal carries, as a campaign stores it."""

from app.core.definition import Prediction
from app.core.tuning.strategy import Proposal


def prediction_of(proposal: Proposal) -> Prediction | None:
    """The prediction stored with a flight of the proposal, for later comparison."""
    if proposal.predicted_error is None:
        return None
    interval = proposal.interval
    return Prediction(
        error=proposal.predicted_error,
        lower=None if interval is None else interval.lower,
        upper=None if interval is None else interval.upper,
    )
