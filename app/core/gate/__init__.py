"""The gate: checks that a policy must pass before it may fly, for proposals, manual gains and scripts alike.

`judging` combines the checks, `bounds` compares gains with limits, and the experiment checks its own hazards
(`app.core.hazards` for the takeoff). `overruling` reports refusals and decides who may overrule them.
"""

from app.core.gate.judging import GateResult, check_policy
from app.core.gate.overruling import require_flyable

__all__ = ["GateResult", "check_policy", "require_flyable"]
