"""The set points that follow the takeoff's, as pure functions of a trial: when each is commanded, whether the vehicle
is at rest before the first, and when each took effect.

Times are by the vehicle's clock, which is known from its positions and their latency, up to the least latency itself.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from app.core.experiments.step_sequence import SETTLED_FOR_S, unsettled
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.events import Action, ActionDone, PerformAction, Position
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.trial_reactions import SetPointChange, Step, Trial

LEAD_S: Final = 0.02
"""Usual time from the command of a set point to its effect: it is commanded so much before it is due."""


def note_settling(trial: Trial, positions: tuple[Position, ...]) -> Trial:
    """Note the positions by which the vehicle is at rest before the first step; none if there is no step."""
    first_s, start_s = _next_due_s(trial), trial.commanded_boot_s
    if trial.changes or trial.changes_set_point or first_s is None or start_s is None:
        return trial
    recent = tuple(each for each in positions if each.time_boot_s - start_s >= first_s - SETTLED_FOR_S)
    return replace(trial, settling=(*trial.settling, *recent)) if recent else trial


def is_due(trial: Trial, now_s: float) -> bool:
    """Whether the next set point is to be commanded now. While the vehicle has not confirmed the previous one, none
    is."""
    due_s = _next_due_s(trial)
    return due_s is not None and not trial.changes_set_point and _elapsed_s(trial, now_s) >= due_s - LEAD_S


def find_unsettled(trial: Trial) -> Finding | None:
    """Find that the vehicle is not at rest before the first step."""
    first_s, start_s = _next_due_s(trial), trial.commanded_boot_s
    if trial.changes or first_s is None or start_s is None:
        return None
    time_s = np.array([each.time_boot_s - start_s for each in trial.settling])
    altitude_m = np.array([each.altitude_m - trial.plan.datum_m for each in trial.settling])
    why = unsettled(time_s, altitude_m, first_s, trial.plan.set_points.altitudes_m[0])
    return None if why is None else Finding(failure=Failure.NOT_SETTLED, why=f"The vehicle {why}.")


def command_next(trial: Trial) -> Step:
    """Command the next set point, to which all limits refer from now on."""
    set_point_m = trial.plan.set_points.altitudes_m[len(trial.changes) + 1] + trial.plan.datum_m
    trial = replace(
        trial,
        plan=trial.plan.with_set_point(set_point_m),
        watch=watching.change_set_point(trial.watch, set_point_m),
        changes_set_point=True,
        settling=(),
    )
    return trial, (PerformAction(Action.FLY_TO, set_point_m),)


def confirm(trial: Trial, done: ActionDone) -> Trial:
    """Note that the vehicle has confirmed the set point, and when it took effect.

    The vehicle replies at once, so that the reply has the least latency of its positions. If the message was repeated
    because a reply was lost, an earlier sending may have taken effect, after the same delay.
    """
    sent_s = done.sent_s or (done.now_s,)
    delay_s = (done.now_s if done.replied_s is None else done.replied_s) - sent_s[-1]
    altitude_m = trial.plan.set_points.altitudes_m[len(trial.changes) + 1]
    times_s = tuple(_elapsed_s(trial, at_s + delay_s) for at_s in sent_s)
    return replace(trial, changes=(*trial.changes, SetPointChange(altitude_m, times_s)), changes_set_point=False)


def _next_due_s(trial: Trial) -> float | None:
    """Time of the next set point since the takeoff command; None after the last."""
    times_s, number = trial.plan.set_points.times_s, len(trial.changes) + 1
    return times_s[number] if number < len(times_s) else None


def _elapsed_s(trial: Trial, now_s: float) -> float:
    """Vehicle's time since the takeoff command, at a time of the ground's clock."""
    offset_s, start_s = trial.watch.least_offset_s, trial.commanded_boot_s
    return float("-inf") if offset_s is None or start_s is None else now_s - offset_s - start_s
