"""A flight as a log holds it: its parts, and the loop that flew them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from app.core.analysis.loop import AltitudeLoop
from app.core.analysis.segment import Segment


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedFlight:
    """Segments of one flight with the same parameters, and the loop with these.

    `activity` is the standard deviation of the demanded throttle about its own 2 Hz low-pass, share of full, if it was
    recorded: the noise of an accelerometer that is not in the log follows from it. `assumed` names parameters that the
    record lacks, so that the loop has the firmware's defaults.
    """

    loop: AltitudeLoop
    segments: Sequence[Segment]
    activity: float | None = None
    assumed: Sequence[str] = ()

    @property
    def error_m(self) -> float:
        """Mean distance between reference and altitude, over the scored rows of all segments."""
        return float(np.mean(np.concatenate([np.abs(each.z_d_m - each.z_m)[each.scored] for each in self.segments])))

    def with_hover(self, hover_throttle: float) -> Self:
        """The flight under a loop with another value of its parameter for the throttle in hover, which it keeps."""
        segments = [
            replace(each, assumed_hover=np.full_like(each.assumed_hover, hover_throttle)) for each in self.segments
        ]
        return replace(self, loop=self.loop.with_hover(hover_throttle), segments=segments)

    @property
    def throttle_mean(self) -> float:
        """Mean throttle of all segments."""
        return float(np.mean(np.concatenate([each.throttle_filtered for each in self.segments])))
