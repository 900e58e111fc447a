"""Two steps of half a metre at a height of 2.5 m: an example of an experiment."""

from collections.abc import Mapping
from typing import Final, Self

from app.core.definition import OptionValue
from app.core.experiments.altitude_steps import CLIMB_S, AltitudeSteps
from app.core.experiments.step_sequence import StepSequence

SEQUENCE: Final = StepSequence(climb_s=CLIMB_S, height_m=2.5, step_m=0.5, steps=2)


class SmallSteps(AltitudeSteps):
    """Altitude steps of its own heights, which no option changes, scored as these."""

    name = "small-steps"
    title = "Small steps"
    options = ()

    def __init__(self, *, sequence: StepSequence = SEQUENCE) -> None:
        super().__init__(sequence=sequence)

    def configured(self, _options: Mapping[str, OptionValue]) -> Self:
        return self
