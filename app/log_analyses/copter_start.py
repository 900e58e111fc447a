"""What a campaign takes of the analysis of an ArduCopter's or PX4's log."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.autopilots.registry import EXPERIMENTS
from app.core.analysis.analysis import Analysis
from app.core.definition import LogEvidence
from app.core.errors import Problem, TrajectoryError
from app.core.experiments.copter_steps import CopterSteps, vector_of

STEPS: Final[Mapping[str, CopterSteps]] = MappingProxyType(
    {each.autopilot: each for each in EXPERIMENTS.values() if isinstance(each, CopterSteps)}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CopterStart:
    """The experiment, the gains of the first flight by the names of its space, and what the log tells."""

    experiment: str
    gains: Mapping[str, float]
    log: LogEvidence


def start_of(analysis: Analysis, file_name: str) -> CopterStart:
    """The start of a campaign with the proposed gains. Raises TrajectoryError if the analysis proposes none."""
    if analysis.proposed is None:
        raise TrajectoryError(
            f"No campaign starts from {file_name}.",
            hint=analysis.answer,
            problems=(Problem("file", "gives no better gains to begin with"),),
        )
    experiment = STEPS[analysis.loop.texts.autopilot]
    parameters = analysis.loop.firmware_parameters
    proposed = experiment.loop_parameters(analysis.proposed.gains)
    space = experiment.space
    mean, deviation = (vector_of(each).tolist() for each in (analysis.estimate.mean, analysis.estimate.deviation))
    return CopterStart(
        experiment=experiment.name,
        gains=space.mapping(space.nearest(space.vector({name: parameters[name] for name in space.names} | proposed))),
        log=LogEvidence(
            file_name=file_name,
            error_m=analysis.behaviour.error_m,
            vehicle={
                each.name: (min(max(value, each.lower), each.upper), spread)
                for each, value, spread in zip(experiment.model_parameters, mean, deviation, strict=True)
            },
            parameters=parameters,
        ),
    )
