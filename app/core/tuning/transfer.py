"""Warm start: transfer of another vehicle's campaign to this one.

The best gains of vehicle A are flown first on vehicle B. Each of the two flights then has a bias, b(t) = measured(t) −
nominal model(t; flown gains). A's model is useful if A's bias explains B's, apart from the scatter found between
repeated flights of one vehicle:

    agreement = 1 − max(⟨(b_B − b_A)²⟩ − 2 s², 0) / ⟨b_B²⟩,  limited to 0 … 1,

where ⟨·⟩ is the mean over the window and s the scatter as an offset of the output. From an agreement of one half on,
A's fitted model replaces the data sheet, with standard deviations that grow as the agreement falls, and the first step
is shortened to that share.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import ModelledExperiment
from app.core.formatting import percent
from app.core.records.trajectory import CHANNEL_UNITS
from app.core.tuning.calibration import calibrate
from app.core.tuning.campaign_models import CALIBRATED, as_flown
from app.core.tuning.corrected_model import correct_by_bias
from app.core.tuning.evidence import Evidence
from app.core.tuning.predictions import offset_sensitivity

LEAST_AGREEMENT: Final = 0.5
_TAKEN: Final = {
    True: "The model fitted to the other vehicle's flight replaces the data sheet",
    False: "The other vehicle's best gains are used",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """Result of a transfer.

    `agreement` is None without a donor, and until this vehicle has flown; `experiment` and `step_fraction` are those
    the strategy has to use.
    """

    experiment: ModelledExperiment
    step_fraction: float
    agreement: float | None
    sentence: str


def informed_evidence(plain: Evidence[ModelledExperiment]) -> tuple[Evidence[ModelledExperiment], str]:
    """The evidence with the model and the step limit that follow from the donor's flight and with the autopilot's
    parameters as flown, before the first own flight those of the donor's, whose vehicle is of the same kind; and a
    sentence about the transfer, empty if there is none."""
    warm = transfer(plain)
    flown = plain.flights if plain.donor is None else (plain.donor, *plain.flights)
    definition = replace(plain.definition, step_fraction=warm.step_fraction)
    experiment = as_flown(warm.experiment, flown)
    return replace(plain, definition=definition, experiment=experiment, plain=plain), warm.sentence


def transfer(evidence: Evidence[ModelledExperiment]) -> Transfer:
    """Compute the transfer from the first valid flight, for the whole campaign; only the next step is shortened."""
    definition, experiment, valid, donor = evidence.definition, evidence.experiment, evidence.valid, evidence.donor
    plain = Transfer(experiment=experiment, step_fraction=definition.step_fraction, agreement=None, sentence="")
    if donor is None or not valid:
        return plain
    agreed, apart, own = _agreement(experiment, donor, valid[0])
    unit = CHANNEL_UNITS.get(experiment.output, "")
    numbers = (
        f"this vehicle deviates from the data sheet's model by {own:.3f} {unit} r.m.s., from the other vehicle by "
        f"{apart:.3f} {unit}: agreement {percent(agreed)}"
    )
    if agreed < LEAST_AGREEMENT:
        sentence = f"Nothing is used from the other vehicle: {numbers}, less than {percent(LEAST_AGREEMENT)}."
        return replace(plain, agreement=agreed, sentence=sentence)
    is_first_step = len(valid) == 1
    shortened = (
        f" The first step is limited to {percent(agreed)} of its maximum." if is_first_step and agreed < 1.0 else ""
    )
    return Transfer(
        experiment=_informed(experiment, donor, agreed),
        step_fraction=definition.step_fraction * (agreed if is_first_step else 1.0),
        agreement=agreed,
        sentence=f"{_TAKEN[isinstance(experiment, CALIBRATED)]}: {numbers}.{shortened}",
    )


def _agreement(experiment: ModelledExperiment, donor: Flight, own: Flight) -> tuple[float, float, float]:
    """Agreement as above, and the r.m.s. of b_B − b_A and of b_B, in the output's unit."""
    theirs, ours = correct_by_bias(experiment, donor).bias, correct_by_bias(experiment, own).bias
    apart, whole = float(np.mean((ours - theirs) ** 2)), float(np.mean(ours**2))
    scatter = (experiment.scatter.sd / offset_sensitivity(experiment)) ** 2
    unexplained = max(apart - 2.0 * scatter, 0.0)
    agreed = 1.0 - unexplained / whole if whole > unexplained else 0.0
    return (agreed if unexplained else 1.0), float(np.sqrt(apart)), float(np.sqrt(whole))


def _informed(experiment: ModelledExperiment, donor: Flight, agreed: float) -> ModelledExperiment:
    """The donor's fit as the nominal model, each standard deviation widened by the disagreement of the two vehicles.

    The experiment itself if there is no calibration for it.
    """
    if not isinstance(experiment, CALIBRATED):
        return experiment
    fitted = calibrate(experiment, (donor,))
    variances = np.diag(fitted.covariance) + (1.0 - agreed) * experiment.prior_sd**2
    return experiment.informed(fitted.model, np.sqrt(variances))
