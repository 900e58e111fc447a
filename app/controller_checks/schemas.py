"""API schemas of controller checks."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from app.common.schemas import Gains


class ControllerCheckSummary(BaseModel):
    """A recording that was compared with the replica: `log`, of a flight with Paparazzi, or `trace`, with every
    step."""

    id: int
    file_name: str
    kind: Literal["log", "trace"]
    passed: bool
    checked_at: datetime


class CheckedSignal(BaseModel):
    """One signal of the loop. `exact`: no difference at all; `agrees`: within the tolerance; `differs`."""

    name: str
    title: str
    largest_difference: float
    difference_unit: str
    tolerance: Annotated[float, Field(description="the largest difference allowed, in the same unit")]
    allowance: Annotated[str, Field(description="what the tolerance means, in words")]
    verdict: Literal["exact", "agrees", "differs"]
    different: Annotated[int, Field(description="how many samples differ by more than is allowed")]
    first_different_s: float | None


class CheckFigure(BaseModel):
    """An available figure of the check."""

    name: Literal["reference", "commands"]
    title: str


class ControllerCheck(ControllerCheckSummary):
    """The result as a sentence, the gains and notes behind it, and one line for each signal."""

    sentence: str
    rows: Annotated[int, Field(description="how many samples or steps were compared")]
    gains: Annotated[Gains | None, Field(description="null where they change within the recording")]
    gains_from: str
    better_gains: Annotated[Gains | None, Field(description="other gains that more of the commands follow from")]
    notes: list[str]
    signals: list[CheckedSignal]
    figures: list[CheckFigure]
