"""What a simulated vehicle can hold of the gains it is given."""

from collections.abc import Callable, Sequence

from app.core.errors import GainsError, Problem
from app.core.policy import Gains


def accept_gains(
    gains: Gains, names: Sequence[str], refusal: Callable[[float], str | None], *, kind: type[float], numbers: str
) -> dict[str, float]:
    """The gains, complete and in order, each as `kind`. Raises GainsError naming every unknown or missing gain and each
    that `refusal` gives a reason against; `numbers` says which could be held."""
    problems = [Problem(f"gains.{name}", "is not a gain of this vehicle") for name in gains if name not in names]
    for name in names:
        reason = refusal(gains[name]) if name in gains else "is missing"
        if reason is not None:
            problems.append(Problem(f"gains.{name}", reason))
    if problems:
        raise GainsError(
            "The vehicle cannot hold these gains.",
            problems=tuple(problems),
            hint=f"Send {', '.join(names)} as {numbers}.",
        )
    return {name: kind(gains[name]) for name in names}
