"""What is predicted for a trial at the moment it is planned, also for gains that no proposal contains."""

from contextlib import suppress
from dataclasses import dataclass

from sqlalchemy.orm import Session

from app.campaigns.flight_predictions import PredictorCache, fit_model, predict_planned
from app.campaigns.schemas import GainsPrediction
from app.campaigns.trials.schemas import TrialPlan
from app.campaigns.trials.service import find_gains
from app.common.errors import GainlineError
from app.core.policy import Gains
from app.db.models import CampaignRow


@dataclass(frozen=True, slots=True)
class TrialPredictor:
    """Predicts planned trials as the dashboard shows them."""

    cache: PredictorCache

    def prepare(self, session: Session, campaign_id: int, new: TrialPlan) -> None:
        """Run the gate's simulations and fit the model before the transaction of `create_trial` needs the results,
        which are kept. Problems with the trial are reported by `create_trial`."""
        with suppress(GainlineError):
            gains = find_gains(session, campaign_id, new)
            if new.proposal_id is None:
                fit_model(session, self.cache, campaign_id, gains)

    def predict(self, session: Session, campaign: CampaignRow, gains: Gains) -> GainsPrediction:
        """What is predicted for a trial with these gains."""
        return predict_planned(session, self.cache, campaign, gains)
