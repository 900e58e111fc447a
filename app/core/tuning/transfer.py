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
    """Result of a transfer: the `evidence` that the strategy has to use, with a `sentence` about it; empty without
    a donor, and until this vehicle has flown."""

    evidence: Evidence[ModelledExperiment]
    sentence: str = ""


def transfer(campaign: Evidence[ModelledExperiment]) -> Transfer:
    """The evidence with the model and the step limit that follow from the donor's flight and with the autopilot's
    parameters as flown, before the first own flight those of the donor's, whose vehicle is of the same kind.

    The transfer is computed from the first valid flight, for the whole campaign; only the next step is shortened.
    """
    donor, valid = campaign.donor, campaign.valid
    flown = campaign.flights if donor is None else (donor, *campaign.flights)

    def modelled(experiment: ModelledExperiment, share: float = 1.0) -> Evidence[ModelledExperiment]:
        definition = replace(campaign.definition, step_fraction=campaign.definition.step_fraction * share)
        return replace(campaign, definition=definition, experiment=as_flown(experiment, flown), plain=campaign)

    experiment = campaign.experiment
    if donor is None or not valid:
        return Transfer(evidence=modelled(experiment))
    agreed, apart, own = _agreement(experiment, donor, valid[0])
    unit = CHANNEL_UNITS.get(experiment.output, "")
    numbers = (
        f"this vehicle deviates from the data sheet's model by {own:.3f} {unit} r.m.s., from the other vehicle by "
        f"{apart:.3f} {unit}: agreement {percent(agreed)}"
    )
    if agreed < LEAST_AGREEMENT:
        sentence = f"Nothing is used from the other vehicle: {numbers}, less than {percent(LEAST_AGREEMENT)}."
        return Transfer(evidence=modelled(experiment), sentence=sentence)
    share = agreed if len(valid) == 1 else 1.0
    shortened = f" The first step is limited to {percent(share)} of its maximum." if share < 1.0 else ""
    return Transfer(
        evidence=modelled(_informed(experiment, donor, agreed), share),
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
