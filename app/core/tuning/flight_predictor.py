"""Prediction of a flight with any gains, by the model that the campaign's next proposal comes from."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.core.definition import Definition, Flight
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.policy import Gains
from app.core.statistics.comparisons import groups_of, pool_scatter
from app.core.tuning.calibration import fitted_flights
from app.core.tuning.campaign_models import FITTED
from app.core.tuning.corrected_model import start_model
from app.core.tuning.evidence import Evidence
from app.core.tuning.predictions import repeat_proposal, with_interval
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategy import Explanation, Predictor, Proposal, proposal_of
from app.core.tuning.transfer import informed_evidence

_UNEXPLAINED = Explanation(summary="")


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPredictor:
    """The campaign's model, fitted once and asked for many gain sets.

    `base` is the flight whose bias corrects the model, None for an uncorrected one.
    """

    evidence: Evidence[ModelledExperiment]
    model: Predictor
    base: Flight | None

    def predict(self, gains: Gains) -> Proposal:
        """Predict a flight with a complete set of gains: its curve with a band, and its error with an interval."""
        predicted = self.model.predict(self.evidence.space.vector(gains))
        return with_interval(self.evidence, proposal_of("manual", gains, predicted, _UNEXPLAINED), base=self.base)


def flight_predictor(
    definition: Definition, experiment: Experiment, flights: Sequence[Flight], donor: Flight | None = None
) -> FlightPredictor | None:
    """The predictor after these flights, with the model that `next_proposal` uses for them; None without a model.

    A fit takes up to half a second; a prediction some milliseconds, or a tenth of a second under ArduCopter.
    """
    modelled = experiment.modelled
    if modelled is None:
        return None
    evidence, _ = informed_evidence(definition, modelled, flights, donor)
    is_corrected = bool(evidence.valid) and STRATEGIES[definition.strategy].corrects_model
    base = evidence.best if is_corrected else None
    return FlightPredictor(evidence=evidence, model=model_of(evidence, donor), base=base)


def model_of(evidence: Evidence[ModelledExperiment], donor: Flight | None) -> Predictor:
    """The strategy's model; before the first valid flight the nominal one, or the one corrected by the donor's."""
    if not evidence.valid:
        return start_model(evidence.experiment, donor)
    return STRATEGIES[evidence.definition.strategy].model(evidence)


def modelled_flights(experiment: Experiment, flights: Sequence[Flight]) -> frozenset[int]:
    """Numbers of the flights whose records `flight_predictor` needs."""
    valid = [flight for flight in flights if flight.outcome == "valid"]
    used = fitted_flights(flights) if valid and isinstance(experiment, FITTED) else valid
    return frozenset(flight.number for flight in (*valid[:1], *used))


def predict_repeat(experiment: Experiment, flights: Sequence[Flight], gains: Gains) -> Proposal | None:
    """Predict another flight of gains that were flown: the mean of their flights; None if no valid flight had them.

    Only the flights with these gains need their records.
    """
    groups = groups_of(flights)
    group = next((each for each in groups if each.gains == gains), None)
    if group is None:
        return None
    scatter = pool_scatter(groups, experiment.scatter)
    return repeat_proposal(experiment, flights, group, scatter, "repeat", _UNEXPLAINED)
