"""Two steps of half a metre at a height of 2.5 m: an example of an experiment."""

from collections.abc import Mapping
from typing import Final, Self

from app.core.definition import OptionValue
from app.core.experiments.altitude_steps import CLIMB_S, AltitudeSteps
from app.core.experiments.base import ModelParameter
from app.core.experiments.step_sequence import StepSequence
from app.core.experiments.vertical_loop import MODEL_PARAMETERS

SEQUENCE: Final = StepSequence(climb_s=CLIMB_S, height_m=2.5, step_m=0.5, steps=2)


class SmallSteps(AltitudeSteps):
    """Altitude steps of its own heights, which no option changes, scored as these."""

    name = "small-steps"
    title = "Small steps"
    options = ()

    def __init__(
        self, model_parameters: tuple[ModelParameter, ...] = MODEL_PARAMETERS, *, sequence: StepSequence = SEQUENCE
    ) -> None:
        super().__init__(model_parameters, sequence=sequence)

    def configured(self, _options: Mapping[str, OptionValue]) -> Self:
        return self
