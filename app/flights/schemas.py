"""API schemas of flights."""

from typing import Annotated

from pydantic import Field

from app.common.schemas import Schema
from app.flights.readiness import LossKind, ReadinessStep


class ReadinessLoss(Schema):
    """A reason why readiness is lost: what it means now, and what to do."""

    kind: LossKind
    what: str
    way_on: str


class TrialReadiness(Schema):
    """How far a flight has come, for this client: steps that hold, in order, and steps that were reached and lost."""

    steps: list[ReadinessStep]
    lost: list[ReadinessStep]
    losses: Annotated[list[ReadinessLoss], Field(description="why; the takeoff is refused while there is any")]
    is_ready: Annotated[bool, Field(description="whether the takeoff of the staged vehicle may be requested")]
