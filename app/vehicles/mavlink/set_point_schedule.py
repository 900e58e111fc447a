"""The set points that follow the takeoff's, as pure functions of a trial: when each is commanded, whether the vehicle
is at rest before the first, and when each took effect.

Times are by the vehicle's clock, which is known from its positions and their latency, up to the least latency itself.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from app.autopilots.commands import Action
from app.autopilots.measurements import Position
from app.core.experiments.step_sequence import SETTLED_FOR_S, unsettled
from app.core.formatting import count
from app.core.models.set_points import SetPoints
from app.vehicles.mavlink.events import ActionDone, PerformAction
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.monitors.commanded import SetPointChange
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.trial_state import Step, Trial

HELD_BEFORE_S: Final = 6.0
"""Time before the first step from which a vehicle holds the first set point by position targets."""
_LATE_S: Final = 1.5
"""Permitted delay of a set point."""
_OVERDUE: Final = 1.2
"""Share of the permitted delay after which no confirmation is awaited: a refusal, with its reason, comes before."""
LEAD_S: Final = 0.02
"""Usual time from the command of a set point to its effect: it is commanded so much before it is due."""


def with_hold(set_points: SetPoints) -> SetPoints:
    """The set points with the first one again, for a vehicle that must hold it by position targets before it steps."""
    first_s, *others_s = set_points.times_s
    first_m, *others_m = set_points.altitudes_m
    return SetPoints(
        (first_s, others_s[0] - HELD_BEFORE_S, *others_s),
        (first_m, first_m, *others_m),
        set_points.accelerations_m_s2[:1] + set_points.accelerations_m_s2,
    )


def referred_from_s(plan: Plan) -> float:
    """Time since the takeoff command from which the autopilot's reference must be known; infinite without steps."""
    times_s = plan.set_points.times_s
    return times_s[plan.first_step] - SETTLED_FOR_S if len(times_s) > 1 else math.inf


def note_settling(trial: Trial, positions: tuple[Position, ...]) -> Trial:
    """Note the positions by which the vehicle is at rest before the first step; none if there is no step."""
    from_s, start_s, seen = referred_from_s(trial.plan), trial.commanded_boot_s, trial.set_points
    if len(seen.changes) >= trial.plan.first_step or start_s is None:
        return trial
    recent = tuple(each for each in positions if each.time_boot_s - start_s >= from_s)
    return replace(trial, set_points=replace(seen, settling=(*seen.settling, *recent))) if recent else trial


def is_due(trial: Trial, now_s: float) -> bool:
    """Whether the next set point is to be commanded now. While the vehicle has not confirmed the previous one, none
    is; it holds the first one once its climb is over, but no later than it must be at rest."""
    due_s, elapsed_s = _time_s(trial, len(trial.set_points.changes) + 1), _elapsed_s(trial, now_s)
    waits = is_hold(trial) and _climbs(trial) and elapsed_s < referred_from_s(trial.plan)
    return elapsed_s >= due_s - LEAD_S and not (waits or trial.set_points.is_changing)


def is_hold(trial: Trial) -> bool:
    """Whether the next set point is the first one again."""
    return trial.plan.holds_first and not trial.set_points.changes


def find_unsettled(trial: Trial) -> Finding | None:
    """Find that the vehicle is not at rest before the first step, or still climbs when it should hold."""
    plan, start_s = trial.plan, trial.commanded_boot_s
    why: str | None = None
    if is_hold(trial):
        why = "had not ended its climb by itself in time for the first step" if _climbs(trial) else None
    elif len(trial.set_points.changes) + 1 == plan.first_step and start_s is not None:
        time_s = np.array([each.time_boot_s - start_s for each in trial.set_points.settling])
        altitude_m = np.array([each.altitude_m - plan.datum_m for each in trial.set_points.settling])
        why = unsettled(time_s, altitude_m, plan.set_points.times_s[plan.first_step], plan.set_points.altitudes_m[0])
    return None if why is None else Finding(Failure.NOT_SETTLED, f"The vehicle {why}.")


def find_overdue(trial: Trial, now_s: float) -> Finding | None:
    """Find that the next step is not confirmed although it was due long ago."""
    due_s = _time_s(trial, max(len(trial.set_points.changes) + 1, trial.plan.first_step))
    if _elapsed_s(trial, now_s) <= due_s + _OVERDUE * _LATE_S * trial.plan.timeout_factor:
        return None
    return Finding(Failure.SET_POINT, f"The set point of {due_s:g} s was not confirmed in time.")


def find_late(trial: Trial) -> Finding | None:
    """Find that the newest set point took effect late, and not the first one again, which may wait for the climb."""
    changes, plan = trial.set_points.changes, trial.plan
    number = len(changes)
    late_s = changes[-1].times_s[-1] - plan.set_points.times_s[number]
    if number < plan.first_step or late_s <= _LATE_S * plan.timeout_factor:
        return None
    return Finding(Failure.SET_POINT, f"A set point took effect {late_s:.1f} s late.")


def find_missing(trial: Trial) -> Finding | None:
    """Find at the end of the record that not every set point was commanded and confirmed."""
    missing = len(trial.plan.set_points.times_s) - 1 - len(trial.set_points.changes)
    return Finding(Failure.SET_POINT, f"The record ended without {count(missing, 'set point')}.") if missing else None


def command_next(trial: Trial) -> Step:
    """Command the next set point, to which all limits refer from now on. The first one again changes no limit."""
    number, commanded = len(trial.set_points.changes) + 1, replace(trial.set_points, is_changing=True)
    set_point_m = trial.plan.set_points.altitudes_m[number] + trial.plan.datum_m
    if is_hold(trial):
        return replace(trial, set_points=commanded), (PerformAction(Action.HOLD, set_point_m),)
    trial = replace(
        trial,
        plan=replace(trial.plan, set_point_m=set_point_m),
        watch=trial.watch.change_set_point(set_point_m),
        set_points=commanded,
    )
    acceleration_m_s2 = trial.plan.set_points.acceleration_of(number)
    return trial, (PerformAction(Action.FLY_TO, set_point_m, acceleration_m_s2),)


def confirm(trial: Trial, done: ActionDone) -> Trial:
    """Note that the vehicle has confirmed the set point, and when it took effect.

    The vehicle replies at once, so that the reply has the least latency of its positions. If the message was repeated
    because a reply was lost, an earlier sending may have taken effect, after the same delay.
    """
    sent_s = done.sent_s or (done.now_s,)
    delay_s = (done.now_s if done.replied_s is None else done.replied_s) - sent_s[-1]
    altitude_m = trial.plan.set_points.altitudes_m[len(trial.set_points.changes) + 1]
    times_s = tuple(_elapsed_s(trial, at_s + delay_s) for at_s in sent_s)
    return replace(trial, set_points=trial.set_points.confirm(SetPointChange(altitude_m, times_s)))


def _climbs(trial: Trial) -> bool:
    """Whether the vehicle has not yet entered the mode in which it hovers after the climb, if there is one."""
    modes = trial.plan.autopilot.hovering_modes
    return bool(modes) and trial.watch.modes.agreed not in modes


def _time_s(trial: Trial, number: int) -> float:
    """Time of a set point since the takeoff command, counted from the takeoff's, 0; infinite if there is none."""
    times_s = trial.plan.set_points.times_s
    return times_s[number] if number < len(times_s) else math.inf


def _elapsed_s(trial: Trial, now_s: float) -> float:
    """Vehicle's time since the takeoff command, at a time of the ground's clock."""
    offset_s, start_s = trial.watch.clock.least_offset_s, trial.commanded_boot_s
    return float("-inf") if offset_s is None or start_s is None else now_s - offset_s - start_s
