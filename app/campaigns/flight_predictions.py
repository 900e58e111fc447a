"""Predictions of flights with gains that a person considers, by a model that is fitted once for each history."""

import math
from collections import OrderedDict
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Lock
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import history, repository
from app.campaigns.definitions import flown_evidence
from app.campaigns.schemas import GainsPrediction, PredictedCurve
from app.core.experiments.base import Experiment
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory, select_samples
from app.core.tuning.evidence import Evidence
from app.core.tuning.predictions import is_informative
from app.core.tuning.proposals import FlightPredictor, flight_predictor, modelled_flights, predict_repeat
from app.core.tuning.strategy import Proposal, band_channels
from app.db.models import CampaignRow, TrialRow
from app.db.session import Database
from app.figures.data import Curve, thin_by_bends, thinned

CURVE_POINTS: Final = 500
STORED_POINTS: Final = 1000
"""Samples of a curve that is stored with its trial; a model's has up to 17,000."""
KEPT: Final = 4


@dataclass(frozen=True, slots=True)
class FittedModel:
    """What predicts the flights of one history; None for a history without a model."""

    predictor: FlightPredictor | None


class PredictorCache:
    """The models of the histories asked for last, by digest."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._kept: OrderedDict[str, FittedModel] = OrderedDict()

    def find(self, digest: str) -> FittedModel | None:
        """The model of that history, if it is kept. Hold it: other histories may replace it at any time."""
        return self._kept.get(digest)

    def get(self, digest: str, build: Callable[[], FlightPredictor | None]) -> FittedModel:
        """The model of that history, fitted at the first request; concurrent requests wait for it."""
        with self._lock:
            if digest not in self._kept:
                self._kept[digest] = FittedModel(build())
                while len(self._kept) > KEPT:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(digest)
            return self._kept[digest]


def predict_gains(database: Database, cache: PredictorCache, campaign_id: int, asked: Gains) -> GainsPrediction:
    """What is predicted for a complete gain set: the mean of its flights, or else the flight of the proposal's model.

    Takes some ten milliseconds; up to a second for the first gains after a flight, outside of any transaction. Raises
    NotFoundError, and GainsError when they are not the campaign's gains or no controller can hold them.
    """
    with database.read() as session:
        question = _read(session, cache, campaign_id, asked)
    return _view(question, _predict(cache, question))


@dataclass(frozen=True, slots=True)
class _Question:
    """A complete gain set in a campaign's history; `flown` are the numbers of the valid flights with these gains.

    `evidence` has the records that a prediction needs once these are read; `kept` is the model if it is fitted already.
    """

    evidence: Evidence[Experiment]
    trials: Sequence[TrialRow]
    gains: Gains
    digest: str
    flown: Collection[int]
    kept: FittedModel | None = None

    @property
    def output(self) -> str:
        return self.evidence.experiment.output


@dataclass(slots=True)
class TrialPredictor:
    """Predicts the trial of one request as the dashboard shows it, with as much of its curve as is stored."""

    cache: PredictorCache
    _ahead: _Question | None = field(default=None, init=False)
    _prediction: Proposal | None = field(default=None, init=False)

    def prepare(self, session: Session, campaign_id: int, asked: Gains) -> None:
        """Predict before the transaction that plans a trial with these gains. Raises as `predict_gains` does."""
        question = _read(session, self.cache, campaign_id, asked)
        self._prediction = _stored(question, _predict(self.cache, question))
        self._ahead = question

    def predict(self, session: Session, campaign: CampaignRow, gains: Gains) -> Proposal | None:
        """The prediction within that transaction, which is short: that made ahead if the history is still the same,
        else that of a repeat, else none."""
        question, ahead = _question(session, campaign, gains), self._ahead
        if ahead is not None and (ahead.digest, ahead.gains) == (question.digest, question.gains):
            return self._prediction
        if not question.flown:
            return None
        flights = history.flights_of(session, campaign.id, recorded=question.flown)
        repeat = predict_repeat(replace(question.evidence, flights=flights), question.gains)
        return _stored(question, _checked(question, repeat))


def _question(session: Session, campaign: CampaignRow, asked: Gains) -> _Question:
    trials = history.trials_of(session, campaign.id)
    evidence = flown_evidence(campaign, trials)
    gains = evidence.space.complete(asked)
    digest = history.history_digest(session, campaign, evidence.definition, trials)
    flown = next((group.numbers for group in evidence.groups if group.gains == gains), ())
    return _Question(evidence, trials, gains, digest, flown)


def _read(session: Session, cache: PredictorCache, campaign_id: int, asked: Gains) -> _Question:
    """The question with all that a prediction needs of the database."""
    question = _question(session, repository.get_campaign(session, campaign_id), asked)
    kept = cache.find(question.digest)
    is_new = not question.flown and kept is None
    recorded = modelled_flights(question.evidence) if is_new else question.flown
    flights = history.flights_of(session, campaign_id, recorded=recorded) if is_new or recorded else ()
    donor = history.donor_of(session, question.evidence.definition) if is_new else None
    return replace(question, evidence=replace(question.evidence, flights=flights, donor=donor), kept=kept)


def _predict(cache: PredictorCache, question: _Question) -> Proposal | None:
    evidence, kept = question.evidence, question.kept
    predicted = predict_repeat(evidence, question.gains)
    if predicted is None:
        fitted = cache.get(question.digest, lambda: flight_predictor(evidence) if kept is None else kept.predictor)
        predicted = None if fitted.predictor is None else fitted.predictor.predict(question.gains)
    return _checked(question, predicted)


def _checked(question: _Question, predicted: Proposal | None) -> Proposal | None:
    """The prediction, or only its curve where error, interval and band say nothing; None where the model diverges."""
    if predicted is None or predicted.predicted_error is None or not math.isfinite(predicted.predicted_error):
        return None
    if is_informative(predicted.interval, corrected=history.is_corrected(question.trials)):
        return predicted
    curve = None if predicted.predicted is None else _only(predicted.predicted, question.output)
    return replace(predicted, predicted=curve, predicted_error=None, interval=None)


def _stored(question: _Question, predicted: Proposal | None) -> Proposal | None:
    """The prediction with as much of its curve and band as is drawn."""
    if predicted is None or predicted.predicted is None:
        return predicted
    curve = _only(predicted.predicted, question.output, *band_channels(question.output))
    chosen = select_samples(curve.time_s, curve[question.output], STORED_POINTS)
    thin = {name: values[chosen] for name, values in curve.channels.items()}
    return replace(predicted, predicted=replace(curve, time_s=curve.time_s[chosen], channels=thin))


def _view(question: _Question, predicted: Proposal | None) -> GainsPrediction:
    curve = None if predicted is None else predicted.predicted
    lower, upper = (_curve(curve, channel, thin_by_bends) for channel in band_channels(question.output))
    return GainsPrediction(
        gains=dict(question.gains),
        predicted_error=None if predicted is None else predicted.predicted_error,
        interval=None if predicted is None else predicted.interval,
        curve=_curve(curve, question.output, partial(thinned, points=CURVE_POINTS)),
        lower=lower,
        upper=upper,
    )


def _only(trajectory: Trajectory, *names: str) -> Trajectory:
    """The trajectory with no other channels than these."""
    return replace(trajectory, channels={name: trajectory[name] for name in names if name in trajectory.channels})


def _curve(
    trajectory: Trajectory | None, channel: str, thin: Callable[[Curve], tuple[list[float], list[float]]]
) -> PredictedCurve | None:
    if trajectory is None or channel not in trajectory.channels:
        return None
    time_s, values = thin(Curve(trajectory.time_s, trajectory[channel]))
    return PredictedCurve(time_s=time_s, values=values)
