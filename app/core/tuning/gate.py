"""The gate: checks of a gain set before it is flown. What the controller can hold, the campaign's bounds, its step
limit, the experiment's hazards; how refusals are reported, and who may overrule them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from app.core.definition import was_flown
from app.core.errors import GainsError, Problem
from app.core.experiments.base import Check, Envelope, Experiment, ModelledExperiment, ParameterDistribution
from app.core.formatting import percent
from app.core.policy import Gain, Gains, PolicySpace, Vector
from app.core.tuning.campaign_models import as_flown, known_distribution
from app.core.tuning.corrected_model import start_gains
from app.core.tuning.evidence import Evidence, has_model


def envelope_of(evidence: Evidence[Experiment]) -> Envelope:
    """The campaign's ceiling and safe gains: the vehicle's own, or else the experiment's default gains."""
    own, space = evidence.definition.safe_gains, evidence.experiment.space
    safe_gains = space.mapping(space.default) if own is None else own
    return Envelope(ceiling_m=evidence.definition.ceiling_m, safe_gains=safe_gains)


_LEAST_CHANGE: Final = 0.0005
"""A smaller change, as a share of the range, is none at the digits printed."""

NUMBERS: Final = "numbers"
"""Name of the check that cannot be overruled."""


def check_bounds(space: PolicySpace, gains: Gains) -> tuple[Check, ...]:
    """Return a refusal for each gain outside its bounds, or one passed check."""
    refused = tuple(
        _refusal("bounds", gain, gains, reason, {gain.name: min(max(gains[gain.name], gain.lower), gain.upper)})
        for gain in space.gains
        if (reason := gain.refusal_by_bounds(gains[gain.name])) is not None
    )
    return refused or (Check("bounds", True, "Every gain lies within its bounds.", worst=0.0, limit=0.0),)


def _refusal(check: str, gain: Gain, gains: Gains, reason: str, offer: dict[str, float] | None = None) -> Check:
    worst = _outside(gain, gains[gain.name])
    return Check(check, False, f"{gain.name} {reason}.", worst=worst, limit=0.0, gain=gain.name, offer=offer or {})


def check_step(space: PolicySpace, asked: Gains, references: Sequence[Gains], fraction: float, origin: str) -> Check:
    """Check the largest change of a gain from the nearest of `references`, a share of its range, against `fraction`.

    The change of a gain outside its bounds is that to the bound.
    """
    gains = space.mapping(space.nearest(space.vector(asked)))
    nearest = min(references, key=lambda reference: max(space.change(gains, reference).values()))
    name, worst = max(space.change(gains, nearest).items(), key=lambda item: item[1])
    base = space.vector(nearest)
    low, high = space.reachable(base, fraction)
    vector = space.vector(gains)
    passed = worst <= fraction or bool(((low <= vector) & (vector <= high)).all())
    change = (
        f"{name} changes most, by {percent(worst, 1)} of its range" if worst >= _LEAST_CHANGE else "No gain changes"
    )
    sentence = (
        f"{change}{'' if gains[name] == asked[name] else ' to its bound'}; "
        f"{'at most' if passed else 'only'} {percent(fraction)} is allowed from {origin}."
    )
    beyond = {} if passed else space.mapping(space.nearest(vector.clip(low, high)))
    offer = {gain: value for gain, value in beyond.items() if value != gains[gain]}
    return Check("step", passed, sentence, worst=worst, limit=fraction, gain="" if passed else name, offer=offer)


def jointly_offered(gains: Gains, checks: Sequence[Check]) -> tuple[Check, ...]:
    """The same checks, with each offer replaced by one that passes all of them together.

    Every offer is the requested value clipped to a limit; the one furthest from the request satisfies all limits.
    """
    offers: dict[str, float] = {}
    for name, value in (item for check in checks for item in check.offer.items()):
        offers[name] = max(offers.get(name, gains[name]), value, key=lambda offer: abs(offer - gains[name]))
    return tuple(replace(check, offer={name: offers[name] for name in check.offer}) for check in checks)


def _outside(gain: Gain, value: float) -> float:
    """How far a gain lies outside its bounds, as a share of its range; infinite if it is pinned or not finite."""
    beyond = max(gain.lower - value, value - gain.upper, 0.0)
    if beyond == 0.0:
        return 0.0
    return beyond / gain.span if gain.span and math.isfinite(value) else math.inf


WAIVED_AFTER_VALID_FLIGHT: Final = frozenset({"altitude", "divergence", "lowest altitude", "margin"})
"""Checks of simulated flights that do not refuse gains flown before."""


@dataclass(frozen=True, slots=True)
class GateResult:
    """Verdict on one policy; each check has its worst value and the case that caused it."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def refusals(self) -> tuple[Check, ...]:
        return tuple(check for check in self.checks if not check.passed)

    @property
    def overrulable(self) -> bool:
        """Whether a controller can hold these gains at all."""
        return not any(check.name == NUMBERS for check in self.checks)


def check_policy(
    evidence: Evidence[Experiment],
    gains: Gains,
    *,
    start: Gains | None = None,
    spread: ParameterDistribution | None = None,
) -> GateResult:
    """Check a complete set of gains.

    Checks the numbers, the campaign's bounds, its step limit, and the experiment's hazards if it has a model. Gains of
    a valid flight of this campaign may fly again even if simulated takeoffs exceed the altitude or diverge, because the
    flight is better evidence. The step of a gain outside its bounds is that to the bound. Pure; takes a tenth of a
    second for a takeoff.

    Before the first valid flight a gain may change by `first_step_fraction` of its range from the start gains,
    afterwards by `step_fraction` from any valid flight. `start` gives the start gains if they are known, because the
    search on the model is slow. `spread` gives the vehicle's parameter distribution, for flights without their records.
    """
    definition, space, flights, valid = evidence.definition, evidence.space, evidence.flights, evidence.valid
    numbers = tuple(
        _refusal(NUMBERS, gain, gains, reason)
        for gain in space.gains
        if (reason := gain.refusal_by_controller(gains[gain.name])) is not None
    )
    if numbers:
        return GateResult(numbers)
    hazards: tuple[Check, ...] = ()
    if has_model(evidence):
        known = known_distribution(evidence) if spread is None else spread
        hazards = as_flown(evidence.experiment, flights).hazards(space.vector(gains), known, envelope_of(evidence))
    if was_flown(gains, valid):
        hazards = tuple(_flown_before(check) for check in hazards)
    if valid:
        flown = [flight.gains for flight in valid]
        step = check_step(space, gains, flown, definition.step_fraction, "the nearest flown set")
    else:
        origin = start_gains(evidence) if start is None else start
        before = "the start gains before the first valid flight"
        step = check_step(space, gains, [origin], definition.first_step_fraction, before)
    return GateResult(jointly_offered(gains, (*check_bounds(space, gains), step, *hazards)))


def _flown_before(check: Check) -> Check:
    """The check's result for gains that a valid flight of the campaign has flown."""
    if check.passed or check.name not in WAIVED_AFTER_VALID_FLIGHT:
        return check
    sentence = f"{check.sentence} But a flight of this campaign completed with these gains, so they are allowed again."
    return replace(check, passed=True, sentence=sentence)


def require_flyable(gate: GateResult, *, overrule: str = "", is_real: bool = False) -> str:
    """Return the reason to record with the flight: `overrule` if it lets refused gains fly, else empty.

    On a simulated vehicle an operator may overrule a refusal with a reason, for example to fly the paper's gains (ki =
    1356 can wrap); on a real one this is impossible. Numbers that the controller cannot hold are never overruled.
    Raises GainsError naming every refusal with its gain and, if there is one, a value that would pass.
    """
    if overrule and is_real:
        raise GainsError(
            "The gate cannot be overruled on a real vehicle.",
            hint="Fly these gains on its simulation, or choose gains that pass the gate.",
            problems=(Problem("overrule", "is only for simulated vehicles"),),
        )
    if gate.passed or (overrule and gate.overrulable):
        return "" if gate.passed else overrule
    raise GainsError("The gate refuses these gains.", hint=_hint(gate, is_real), problems=problems_of_gate(gate))


_WEIGHT: Final = (NUMBERS, "bounds", "wrapping", "altitude", "divergence", "abort altitude")
"""Names of checks, the most important first: what cannot be flown, then harm in flight. Others follow."""


def problems_of_gate(gate: GateResult) -> tuple[Problem, ...]:
    """Every refusal with its field, the most important first: `gains.ki`, or `gains` if no single gain is the cause."""
    by_weight = sorted(gate.refusals, key=lambda check: (*_WEIGHT, check.name).index(check.name))
    return tuple(
        Problem(f"gains.{check.gain}" if check.gain else "gains", check.sentence, check.offer) for check in by_weight
    )


def _hint(gate: GateResult, is_real: bool) -> str:
    offers = {name: value for check in gate.refusals for name, value in check.offer.items()}
    offered = ", ".join(f"{name} = {value:g}" for name, value in offers.items())
    nearest = f"The nearest gains that pass these checks: {offered}. " if offered else ""
    choose = "Choose less aggressive gains, or clone the campaign with wider limits."
    may_overrule = (
        ""
        if is_real or not gate.overrulable
        else " On a simulated vehicle you may overrule the gate and give a reason."
    )
    return f"{nearest}{choose}{may_overrule}"


def allows(evidence: Evidence[ModelledExperiment], gains: Vector, spread: ParameterDistribution) -> bool:
    """Whether gains of shape (n,) pass the experiment's hazard checks over the vehicle's parameter distribution."""
    return all(check.passed for check in evidence.experiment.hazards(gains, spread, envelope_of(evidence)))
