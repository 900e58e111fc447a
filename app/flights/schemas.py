"""API schemas of flights."""

from typing import Annotated

from pydantic import Field

from app.common.schemas import Schema
from app.flights.readiness import Loss, ReadinessStep


class TrialReadiness(Schema):
    """How far a flight has come, for this client: steps that hold, in order, and steps that were reached and lost."""

    steps: list[ReadinessStep]
    lost: list[ReadinessStep]
    losses: Annotated[list[Loss], Field(description="why; the takeoff is refused while there is any")]
    is_ready: Annotated[bool, Field(description="whether the takeoff of the staged vehicle may be requested")]
