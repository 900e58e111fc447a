"""ArduCopter's altitude loop as an analysis takes it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.copter import fly, step
from app.autopilots.ardupilot.replica.parameters import ACCELEROMETER_FILTER, LOOP_RATE, Parameters, in_newer_names
from app.autopilots.ardupilot.replica.shaping import square_root
from app.autopilots.copter_loop import CopterLoop
from app.core.analysis.loop import GainSpace, LoopTexts, Run, mean_over, transition_of
from app.core.analysis.segment import Segment, Steps
from app.core.models.copter import (
    DISTURBANCES,
    FLOWN,
    HOVER_THROTTLE,
    REFERENCE,
    Copter,
    Filter,
    accelerometer_filter,
    start_body,
)
from app.core.records.trajectory import Samples

SPACE: Final = GainSpace(
    bounds=MappingProxyType(
        {
            "PSC_POSZ_P": (1.0, 3.0),
            "PSC_VELZ_P": (1.0, 8.0),
            "PSC_ACCZ_P": (0.2, 1.5),
            "PSC_ACCZ_I": (0.2, 3.0),
        }
    ),
    gentle=MappingProxyType({"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.2, "PSC_ACCZ_I": 0.2}),
    ordered=("PSC_ACCZ_P", "PSC_ACCZ_I"),
)
"""An integral gain below 0.2 fails the arming check."""

_TEXTS: Final = LoopTexts(
    autopilot="ArduCopter",
    prefix="PSC_",
    hover_parameter="MOT_THST_HOVER",
    hover_range=(loop.HOVER_MIN, loop.HOVER_MAX),
    hover_use=(
        "the integral has to make up for the difference after every takeoff, and with MOT_HOVER_LEARN at 0, as in a "
        "campaign, the parameter stays as it is"
    ),
    fast_gains="P and I of the acceleration controller",
    lateness="lag",
    what_to_fly=(
        "Fly at a height of 3 m or more in a mode that holds altitude (GUIDED, LOITER, ALT_HOLD, AUTO): hover for 5 s, "
        "climb 2 m, hover for 5 s, descend 2 m, hover for 5 s; with NTUN and CTUN in LOG_BITMASK."
    ),
    lags="motors, accelerometer filter, acceleration controller filters",
    other_controller="terrain following, or a release with another position controller",
    parameter_suffix=".param",
)

_DYNAMIC: Final = [
    loop.THROTTLE,
    loop.THROTTLE_FILTERED,
    loop.VELOCITY_ERROR,
    loop.VELOCITY_DERIVATIVE,
    loop.VELOCITY_SUM,
    loop.FILTERED_TARGET,
    loop.ACCELERATION_ERROR,
    loop.ACCELERATION_DERIVATIVE,
    loop.ACCELERATION_SUM,
]
"""What the loop remembers from one step to the next, on a reference at rest."""

_NUDGE: Final = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class ArduPilotLoop(CopterLoop):
    """The loop (`AltitudeLoop`). `filter_hz` is the cut-off of the accelerometer's filter. `has_newer_names` if the
    vehicle's parameters have the names and units of release 4.7. The acceleration in the log is the sensed one, or the
    change of the climb rate over `row_s`, a whole number of steps."""

    parameters: Parameters
    filter_hz: float
    has_newer_names: bool = False
    row_s: float | None = None

    texts = _TEXTS
    space = SPACE
    fast = ("PSC_ACCZ_P", "PSC_ACCZ_I", "PSC_ACCZ_D", "PSC_ACCZ_FF")
    compared = ((2.0, 7.0, 1.0, 2.0), (3.0, 8.0, 0.5, 3.0))
    throttle_limits = (0.0, 1.0)
    usual_slope = (1.0, 0.25)
    slope_error = 0.0
    target_tolerance_m_s = 0.02
    hover_limits = None

    @property
    def firmware_parameters(self) -> dict[str, float]:
        return self.parameters.named | {LOOP_RATE: 1.0 / self.step_s, ACCELEROMETER_FILTER: self.filter_hz}

    @property
    def accelerometer(self) -> Filter:
        return self.sensor if self.row_s is None else mean_over(self.row_s, self.step_s)

    @property
    def sensor(self) -> Filter:
        return accelerometer_filter(self.filter_hz, self.step_s)

    def named(self, gains: Mapping[str, float]) -> dict[str, float]:
        return in_newer_names(gains) if self.has_newer_names else dict(gains)

    def documented(self, hover_throttle: float) -> dict[str, dict[str, float]]:
        p, i = (float(f"{factor * hover_throttle:.2g}") for factor in (1.0, 2.0))
        name = f"P = {'0.1 ' if self.has_newer_names else ''}hover throttle, I = 2 P"
        return {name: {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": p, "PSC_ACCZ_I": i}}

    def parameter_lines(self, flown: Mapping[str, float], proposed: Mapping[str, float]) -> list[str]:
        """As Mission Planner and MAVProxy load them."""
        return [
            *(f"# {name} was {value:g}" for name, value in flown.items()),
            *(f"{name},{value:g}" for name, value in proposed.items()),
        ]

    def climb_rate_targets(self, segment: Segment) -> Samples:
        p, acceleration = self.parameters.position_p_1_s, self.parameters.acceleration_m_s2
        targets = [square_root(error, p, acceleration, 0.0) for error in (segment.z_d_m - segment.z_m).tolist()]
        return np.array(targets) + segment.v_d_m_s

    def excitation(self, segment: Segment, throttle: float) -> tuple[Samples, Samples]:  # noqa: ARG002
        """Those of the reference, which the loop shapes itself."""
        return segment.v_d_m_s, segment.a_d_m_s2

    def start(self, steps: Steps) -> tuple[float, float]:
        _, v_d, a_d, _ = steps.reference[0].tolist()
        return v_d, a_d

    def packed(self, copter: Copter) -> Samples:
        return copter.packed(filter_hz=self.filter_hz, dt_s=self.step_s)

    def fly(self, run: Run) -> Samples:
        packed = loop.packed(self.parameters, self.step_s)
        state, flown = np.empty(loop.STATE_SIZE), np.empty((len(run.reference), len(FLOWN)))
        loop.start_hover(state, packed, *run.start)
        body = start_body(*run.start, run.copter)
        fly(state, body, packed, run.copter, run.reference, run.disturbances, flown)
        return flown

    def transition(self, copter: Copter, *, late_s: float = 0.0) -> Samples:
        """The copter is late by more lag of its motors."""
        late = replace(copter, motor_lag_s=copter.motor_lag_s + late_s)
        p, packed = loop.packed(self.parameters, self.step_s), self.packed(late)
        return transition_of(lambda nudge: _after_step(p, packed, nudge), len(_DYNAMIC), _NUDGE)


def _after_step(p: loop.Packed, copter: Samples, nudge: Samples) -> Samples:
    hover = float(copter[HOVER_THROTTLE])
    state = np.empty(loop.STATE_SIZE)
    loop.start_hover(state, p, hover, 0.0, 0.0, 0.0)
    state[loop.RESET] = 0.0
    state[loop.ACCELERATION_SUM] = 1000.0 * (hover - p[loop.HOVER])
    state[_DYNAMIC] += nudge[: len(_DYNAMIC)]
    body = start_body(hover, 0.0, 0.0, 0.0, copter) + nudge[len(_DYNAMIC) :]
    step(state, body, p, copter, np.zeros(len(REFERENCE)), np.zeros(len(DISTURBANCES)))
    return np.concatenate([state[_DYNAMIC], body])
