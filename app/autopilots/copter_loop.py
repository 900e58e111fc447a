"""What the altitude loops of ArduCopter and PX4 have in common as an analysis takes them: parameters and gains."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from app.core.analysis.loop import GainSpace, LoopTexts, in_order
from app.core.control.parameter_checks import ReplicaParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class CopterLoop:
    """A loop with these parameters, in steps of `step_s`.

    All its feedback passes through the gains `fast`; `compared` are the gain sets that its proposals are compared with.
    """

    parameters: ReplicaParameters
    step_s: float

    texts: ClassVar[LoopTexts]
    space: ClassVar[GainSpace]
    fast: ClassVar[Sequence[str]]
    compared: ClassVar[Sequence[Sequence[float]]]

    @property
    def gains(self) -> dict[str, float]:
        named = self.parameters.named
        return {name: named[name] for name in self.space.bounds}

    @property
    def assumed_hover_throttle(self) -> float:
        return self.parameters.named[self.texts.hover_parameter]

    @property
    def defaults(self) -> Mapping[str, float]:
        """The firmware's, by the names of the loop's own parameters."""
        return type(self.parameters)().named

    def named(self, gains: Mapping[str, float]) -> dict[str, float]:
        return dict(gains)

    def rules(self, hover_throttle: float) -> dict[str, dict[str, float]]:
        """The firmware's defaults, the rules of its documentation, fixed sets."""
        fixed = [dict(zip(self.space.bounds, values, strict=True)) for values in self.compared]
        return {
            f"{self.texts.autopilot}'s default gains": {name: self.defaults[name] for name in self.space.bounds},
            **self.documented(hover_throttle),
            **{f"For comparison: {in_order(self.named(gains))}": gains for gains in fixed},
        }

    def documented(self, hover_throttle: float) -> dict[str, dict[str, float]]:  # noqa: ARG002
        """Gain sets by the rules of the firmware's documentation, if it has any."""
        return {}

    def with_gains(self, gains: Mapping[str, float]) -> Self:
        return replace(self, parameters=self.parameters.changed(gains))

    def with_hover(self, hover_throttle: float) -> Self:
        return self.with_gains({self.texts.hover_parameter: hover_throttle})

    def with_fast_gains(self, factor: float) -> Self:
        named = self.parameters.named
        return self.with_gains({name: factor * named[name] for name in self.fast})
