"""Handling of refusals: how they are reported, and who may overrule them."""

from app.core.errors import GainsError, Problem
from app.core.gate.judging import GateResult


def require_flyable(gate: GateResult, *, overrule: str = "", is_real: bool = False) -> str:
    """Return the reason to record with the flight: `overrule` if it lets refused gains fly, else empty.

    On a simulated vehicle an operator may overrule a refusal with a reason, for example to fly the paper's gains (ki =
    1356 can wrap); on a real one nobody can. Numbers that the controller cannot hold are never overruled. Raises
    GainsError naming every refusal with its gain and, if there is one, a value that would pass.
    """
    if overrule and is_real:
        raise GainsError(
            "Nobody can overrule the gate on a real vehicle.",
            hint="Fly these gains on its simulation, or choose gains that the gate lets pass.",
            problems=(Problem("overrule", "is only for simulated vehicles"),),
        )
    if gate.passed or (overrule and gate.overrulable):
        return "" if gate.passed else overrule
    raise GainsError("The gate refuses these gains.", hint=_hint(gate, is_real), problems=problems_of_gate(gate))


def problems_of_gate(gate: GateResult) -> tuple[Problem, ...]:
    """Every refusal with its field: `gains.ki`, or `gains` if no single gain is the cause."""
    return tuple(
        Problem(f"gains.{check.gain}" if check.gain else "gains", check.sentence, check.offer)
        for check in gate.refusals
    )


def _hint(gate: GateResult, is_real: bool) -> str:
    offers = {name: value for check in gate.refusals for name, value in check.offer.items()}
    offered = ", ".join(f"{name} = {value:g}" for name, value in offers.items())
    nearest = f"The nearest that these checks let pass: {offered}. " if offered else ""
    choose = "Choose milder gains, or clone the campaign with wider limits."
    may_overrule = "" if is_real or not gate.overrulable else " On a simulated vehicle you may overrule with a reason."
    return f"{nearest}{choose}{may_overrule}"
