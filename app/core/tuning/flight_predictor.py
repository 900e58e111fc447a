"""Prediction of a flight with any gains, by the model that the campaign's next proposal comes from."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from app.core.definition import Definition, Flight, best_flight
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.policy import Gains, PolicySpace
from app.core.statistics.comparisons import PooledScatter, groups_of, pool_scatter
from app.core.tuning.calibration import fitted_flights
from app.core.tuning.campaign_models import as_flown, fit_of
from app.core.tuning.corrected_model import correct_by_bias, uncorrected_model
from app.core.tuning.predictions import predict_corrected, repeat_proposal, with_interval
from app.core.tuning.proposals import has_flown
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategy import Explanation, PredictionOf, Proposal
from app.core.tuning.transfer import transfer

_UNEXPLAINED = Explanation(summary="")


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPredictor:
    """The campaign's model, fitted once and asked for many gain sets.

    `base` is the flight whose bias corrects the model, None for an uncorrected one. Of the other `flights` only gains,
    errors and predictions are used.
    """

    experiment: ModelledExperiment
    space: PolicySpace
    flights: Sequence[Flight]
    scatter: PooledScatter
    model: PredictionOf
    base: Flight | None

    def predict(self, gains: Gains) -> Proposal:
        """Predict a flight with a complete set of gains: its curve with a band, and its error with an interval."""
        trajectory, error, interval = self.model(self.space.vector(gains))
        bare = Proposal(
            kind="manual",
            gains=dict(gains),
            predicted=trajectory,
            predicted_error=error,
            explanation=_UNEXPLAINED,
            interval=interval,
        )
        return with_interval(self.experiment, self.space, self.flights, bare, self.scatter, base=self.base)


def flight_predictor(
    definition: Definition, experiment: Experiment, flights: Sequence[Flight], donor: Flight | None = None
) -> FlightPredictor | None:
    """The predictor after these flights, with the model that `next_proposal` uses for them; None without a model.

    A fit takes up to half a second; a prediction some milliseconds, or a tenth of a second under ArduCopter.
    """
    modelled = experiment.modelled
    if modelled is None:
        return None
    if donor is not None:
        modelled = transfer(definition, modelled, flights, donor).experiment
    modelled = as_flown(modelled, flights, donor)
    strategy, flown = STRATEGIES[definition.strategy], has_flown(flights)
    model = strategy.predict_flight if flown else partial(_first_flight, donor)
    return FlightPredictor(
        experiment=modelled,
        space=experiment.space.narrowed(definition.bounds),
        flights=flights,
        scatter=pool_scatter(groups_of(flights), modelled.scatter),
        model=model(definition, modelled, flights),
        base=best_flight(flights) if flown and strategy.corrects_model else None,
    )


def _first_flight(
    donor: Flight | None, _definition: Definition, experiment: ModelledExperiment, _flights: Sequence[Flight]
) -> PredictionOf:
    """The model before the first valid flight: the nominal one, or the one corrected by the donor's flight."""
    model = uncorrected_model(experiment) if donor is None else correct_by_bias(experiment, donor)
    return partial(predict_corrected, model)


def modelled_flights(experiment: Experiment, flights: Sequence[Flight]) -> frozenset[int]:
    """Numbers of the flights whose records `flight_predictor` needs."""
    valid = [flight for flight in flights if flight.outcome == "valid"]
    used = fitted_flights(flights) if valid and fit_of(experiment) is not None else valid
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
