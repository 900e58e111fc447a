"""Readiness of a trial's vehicle to fly it, as a state machine.

    control → staged → held → in flight → landed → reviewed

Before takeoff a loss takes steps back: what was reached no longer holds, and the takeoff is refused until its way on
was taken. In flight a loss takes nothing back, but tells the operator what the vehicle does now.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field, TypeAdapter

from app.common.errors import ConflictError
from app.common.schemas import Schema
from app.common.states import TrialState, VehicleState
from app.live.hub import VehicleReport
from app.live.messages import SILENT_AFTER_S

ReadinessStep = Literal["control", "staged", "held", "in flight", "landed", "reviewed"]
Steps = tuple[ReadinessStep, ...]
STEPS: Final[Steps] = ("control", "staged", "held", "in flight", "landed", "reviewed")

LossKind = Literal[
    "worker away",
    "not connected",
    "process silent",
    "link silent",
    "gains unknown",
    "battery low",
    "checks failed",
    "quarantined",
    "control ended",
    "controlled by other",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class LossText:
    """What a loss means and the way on, on the ground and in flight. `keeps` are the steps that it leaves.

    `way_on_planned`: the way on for a flight that is not staged, `way_on_watching` for a client that may not command
    the vehicle; both are `way_on` where they are empty.
    """

    what: str
    way_on: str
    way_on_planned: str = ""
    way_on_watching: str = ""
    what_in_flight: str = ""
    way_on_in_flight: str = ""
    keeps: Steps = ("control",)


LOSSES: Final = TypeAdapter(dict[str, LossText]).validate_python(
    tomllib.loads((Path(__file__).parent / "losses.toml").read_text("utf-8").format(silent_s=SILENT_AFTER_S))
)
"""By the kind of loss, and that of the worker of a vehicle without a link."""

_REACHED: Final[Mapping[TrialState, ReadinessStep | None]] = {
    TrialState.PLANNED: "control",
    TrialState.STAGED: "staged",
    TrialState.FLYING: "in flight",
    TrialState.LOST: "landed",
    TrialState.CAPTURED: "landed",
    TrialState.VALID: "reviewed",
    TrialState.ABORTED: "reviewed",
    TrialState.INVALID: "reviewed",
    TrialState.CANCELLED: None,
}
_IN_FLIGHT: Final = STEPS.index("in flight")
_BEGINS_WITHIN_S: Final = 3.0
"""A vehicle on the ground this long after the takeoff was requested has not taken off yet; later it has landed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """What readiness follows from: the stored state of a trial and its vehicle, and who asks.

    `has_link`: the vehicle is registered, with a process that keeps its link. `has_control`: the one who asks may
    command it; `is_controlled_by_other`: may not, because another operator is in control; `may_command`: may take
    control. `min_battery_v`: below it the vehicle does not take off. `take_off_requested`: by the operator of a staged
    flight. `standing_down`: its safe gains are being restored instead. `abort_cause_open`: nobody has stated yet why
    the flight was aborted. `failed_checks`: titles of the items that failed at the last preflight check.
    `was_lost_in_flight`: the record ends before the landing, and nothing was heard of the vehicle since.
    `has_not_landed`: its motors were stopped in the air, it fell, or its landing was not observed. `flown_for_s`: time
    since a flying trial began.
    """

    trial: TrialState
    vehicle: VehicleState
    has_link: bool
    has_control: bool
    is_controlled_by_other: bool = False
    may_command: bool = True
    min_battery_v: float = 0.0
    take_off_requested: bool = False
    standing_down: bool = False
    abort_cause_open: bool = False
    failed_checks: tuple[str, ...] = ()
    was_lost_in_flight: bool = False
    has_not_landed: bool = False
    flown_for_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """Something that takes readiness back, what it means now, and the way on."""

    kind: LossKind
    what: str
    way_on: str


class TrialReadiness(Schema):
    """How far a flight has come, for this client: steps that hold, in order, and steps that were reached and lost."""

    steps: Steps
    lost: Steps
    losses: Annotated[tuple[Loss, ...], Field(description="why; the takeoff is refused while there is any")]
    is_ready: Annotated[bool, Field(description="whether the takeoff of the staged vehicle may be requested")]


def readiness_of(standing: Standing, report: VehicleReport) -> TrialReadiness:
    """Evaluate how far a flight has come and which of it still holds, for who asks: control is no step of theirs while
    another operator has it."""
    steps, lost, losses = _readiness_of(standing, report)
    if standing.is_controlled_by_other:
        steps, lost = (tuple(step for step in each if step != "control") for each in (steps, lost))
    return TrialReadiness(steps=steps, lost=lost, losses=losses, is_ready=steps[-1:] == ("staged",) and not losses)


def _readiness_of(standing: Standing, report: VehicleReport) -> tuple[Steps, Steps, tuple[Loss, ...]]:
    """Steps that hold, steps that were reached and are lost, each in order, and why."""
    reached = _REACHED[standing.trial]
    if standing.trial is TrialState.STAGED and standing.standing_down:
        reached = "control"
    elif standing.trial is TrialState.STAGED and standing.take_off_requested:
        reached = "held"
    elif standing.trial is TrialState.ABORTED and standing.abort_cause_open:
        reached = "landed"
    steps = () if reached is None else STEPS[: STEPS.index(reached) + 1]
    if standing.trial is TrialState.LOST or standing.was_lost_in_flight:  # whether it has landed is not known
        return STEPS[: _IN_FLIGHT + 1], ("landed",), ()
    if standing.has_not_landed and "landed" in steps:
        return tuple(step for step in steps if step != "landed"), ("landed",), ()
    if len(steps) > _IN_FLIGHT + 1 or not steps:
        return steps, (), ()
    kinds = _losses(standing, report)
    texts = LOSSES if standing.has_link else {**LOSSES, "worker away": LOSSES["worker away without link"]}
    if len(steps) > _IN_FLIGHT:
        in_flight = tuple(
            Loss(kind=kind, what=texts[kind].what_in_flight, way_on=texts[kind].way_on_in_flight)
            for kind in kinds
            if texts[kind].what_in_flight
        )
        return STEPS[: STEPS.index(_reached_in_flight(standing, report)) + 1], (), in_flight
    if not standing.has_control and standing.trial is TrialState.PLANNED:
        steps = ()
    kept = min((len(texts[kind].keeps) for kind in kinds), default=len(steps))
    losses = tuple(
        Loss(kind=kind, what=_what(kind, texts, standing), way_on=_way_on(texts[kind], standing)) for kind in kinds
    )
    return steps[:kept], steps[kept:], losses


def _reached_in_flight(standing: Standing, report: VehicleReport) -> ReadinessStep:
    """The step of a trial that flies, by the vehicle's own: it still arms, is in the air, or gets its safe gains. With
    a lost link it is not known to have landed."""
    step = "" if report.status is None or not standing.has_link else report.status.step
    is_starting = step == "idle" and standing.flown_for_s < _BEGINS_WITHIN_S
    if step in {"preflight", "arm"} or is_starting:
        return "held"
    return "landed" if step in {"restore", "idle"} and _link_loss(standing, report) is None else "in flight"


def require_ready(readiness: TrialReadiness) -> None:
    """Raise ConflictError with the first loss, if there is one."""
    if readiness.losses:
        raise ConflictError(readiness.losses[0].what, hint=readiness.losses[0].way_on)


_ENDED_BY_RELEASE: Final = frozenset({"not connected", "gains unknown"})
"""A release needs the connection, and reads the gains back."""


def _what(kind: LossKind, texts: Mapping[str, LossText], standing: Standing) -> str:
    what = texts[kind].what
    return f"{what.removesuffix('.')}: {', '.join(standing.failed_checks)}." if kind == "checks failed" else what


def _way_on(text: LossText, standing: Standing) -> str:
    if text.way_on_watching and not standing.may_command:
        return text.way_on_watching
    return (text.way_on_planned if standing.trial is TrialState.PLANNED else "") or text.way_on


def _losses(standing: Standing, report: VehicleReport) -> list[LossKind]:
    found: list[LossKind] = []
    is_quarantined = standing.vehicle is VehicleState.QUARANTINED
    link = _link_loss(standing, report)
    battery_v = None if report.status is None else report.status.battery_v
    if link is not None and not (is_quarantined and link in _ENDED_BY_RELEASE):
        found.append(link)
    elif link is None and battery_v is not None and battery_v < standing.min_battery_v:
        found.append("battery low")
    if standing.failed_checks and link is None and not is_quarantined:
        found.append("checks failed")
    if is_quarantined:
        found.append("quarantined")
    if not standing.has_control and standing.trial is not TrialState.PLANNED:
        found.append("controlled by other" if standing.is_controlled_by_other else "control ended")
    return found


def _link_loss(standing: Standing, report: VehicleReport) -> LossKind | None:
    """The loss nearest to this computer: what is behind it is not known."""
    if not report.worker:
        return "worker away"
    if not standing.has_link:
        return None
    status = report.status
    if standing.vehicle is VehicleState.DISCONNECTED or status is None or status.state == "connecting":
        return "not connected"
    if status.state == "not answering" or status.age_s > SILENT_AFTER_S:
        return "process silent"
    if status.state == "gone":
        return "link silent"
    return status.unready or None
