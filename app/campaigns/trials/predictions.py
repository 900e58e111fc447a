"""What is predicted for a trial at the moment it is planned, also for gains that no proposal contains."""

from contextlib import suppress
from dataclasses import dataclass, field

from sqlalchemy.orm import Session

from app.campaigns.flight_predictions import DatedPrediction, PredictorCache, predict_ahead, predict_planned
from app.campaigns.trials.schemas import TrialPlan
from app.campaigns.trials.service import find_gains
from app.common.errors import GainlineError
from app.core.policy import Gains
from app.core.tuning.strategy import Proposal
from app.db.models import CampaignRow


@dataclass(slots=True)
class TrialPredictor:
    """Predicts the trial of one request as the dashboard shows it."""

    cache: PredictorCache
    _ahead: DatedPrediction | None = field(default=None, init=False)

    def prepare(self, session: Session, campaign_id: int, new: TrialPlan) -> None:
        """Run the gate's simulations, whose results are kept, and predict the trial before the transaction of
        `create_trial`. Problems with the trial are reported by `create_trial`."""
        with suppress(GainlineError):
            gains = find_gains(session, campaign_id, new)
            if new.proposal_id is None:
                self._ahead = predict_ahead(session, self.cache, campaign_id, gains)

    def predict(self, session: Session, campaign: CampaignRow, gains: Gains) -> Proposal | None:
        """What is predicted for a trial with these gains, as it is stored with it."""
        return predict_planned(session, campaign, gains, self._ahead)
