"""What a controller check looks like from outside."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from app.schemas import Gains


class ControllerCheckSummary(BaseModel):
    """A recording that was held against the replica: `log`, Paparazzi's of a flight, or `trace`, with every step."""

    id: int
    file_name: str
    kind: Literal["log", "trace"]
    passed: bool
    checked_at: datetime


class CheckedSignal(BaseModel):
    """One signal of the loop. `exact`: no difference at all; `agrees`: none that is not allowed; `differs`."""

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
    """A drawing of the check that there is."""

    name: Literal["reference", "commands"]
    title: str


class ControllerCheck(ControllerCheckSummary):
    """The result in a sentence, what it rests on, and one line for each signal."""

    sentence: str
    rows: Annotated[int, Field(description="how many samples or steps were compared")]
    gains: Annotated[Gains | None, Field(description="null where they change within the recording")]
    gains_from: str
    better_gains: Annotated[Gains | None, Field(description="other gains that more of the commands follow from")]
    notes: list[str]
    signals: list[CheckedSignal]
    figures: list[CheckFigure]
