"""What a policy must pass before it may be flown, on every path: proposals, manual gains, scripts.

`judging` puts the checks together, `bounds` holds the gains against limits, and the experiment itself knows its hazards
(`app.core.hazards` for the takeoff). `overruling` says what a refusal means, and who may fly in spite of it.
"""

from app.core.gate.judging import GateResult, check_policy
from app.core.gate.overruling import require_flyable

__all__ = ["GateResult", "check_policy", "require_flyable"]
