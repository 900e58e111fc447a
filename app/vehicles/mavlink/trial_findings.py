"""Findings of a trial from the takeoff command on: the most severe one, and what its mode and block may be."""

from typing import Final

from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.trial_state import STATES_WITH_TRIAL_GAINS, State, Trial

MODE_KNOWN_S: Final = 1.0
"""Time after a command in which heartbeats may still show the mode and block of before."""


def find_in_flight(trial: Trial, now_s: float) -> Finding | None:
    """Return the most severe failure between the command and the end of the record, if any."""
    watch, plan, modes = trial.watch, trial.plan, allowed_modes(trial)
    return (
        (watch.modes.find_taken_over(plan) if modes else None)
        or watch.identity.find_reboot()
        or watch.modes.find_disarming()
        or watch.modes.find_unexpected(plan, modes, _allowed_blocks(trial))
        or find_noted(trial, Failure.UNEXPECTED, Failure.LOST_POSITION)
        or (watch.climb.find_interrupted(watch.modes.agreed, plan) if modes else None)
        or watch.identity.find_duplicate()
        or watch.link.find(plan, watch.modes.heartbeat_s, now_s)
        or watch.positions.find_jump()
        or watch.envelope.find(plan, watch.last, settling=True)
        or watch.modes.find_own_landing(plan, watch.last, mode_known=bool(modes))
        or watching.find_frozen(watch, plan, now_s)
        or watching.find_lost_position(watch, plan, now_s)
        or watch.second.find_disagreement()
        or watch.battery.find(now_s)
    )


def find_noted(trial: Trial, *failures: Failure) -> Finding | None:
    """Return the trial's failure if it is one of these, which end the record."""
    return Finding(trial.failure, trial.why) if trial.failure in failures else None


def find_taken_over(trial: Trial) -> Finding | None:
    """Whether a pilot has taken over, by heartbeats sent certainly after the command."""
    finding = trial.watch.modes.find_taken_over(trial.plan)
    return finding if finding is not None and allowed_modes(trial) else None


def find_change(trial: Trial) -> Finding | None:
    """Return an unexpected change of state during a landing, in which disarming is expected."""
    watch = trial.watch
    return (
        watch.identity.find_duplicate()
        or watch.identity.find_reboot()
        or watch.modes.find_unexpected(trial.plan, allowed_modes(trial), _allowed_blocks(trial))
    )


def is_by_hand(trial: Trial) -> bool:
    """Whether the newest heartbeat shows a manual mode."""
    modes = trial.watch.modes
    return modes.armed and trial.plan.is_manual(modes.mode) and bool(allowed_modes(trial))


def may_be_by_hand(trial: Trial, now_s: float) -> bool:
    """Whether the newest heartbeat shows a manual mode and is not overdue: Land would override the pilot."""
    return is_by_hand(trial) and now_s - trial.watch.modes.heartbeat_s < trial.plan.confirmation_s


def allowed_modes(trial: Trial) -> frozenset[str]:
    """Return the modes that the vehicle may be in. Any (empty) until a heartbeat sent certainly after the command, and
    while the vehicle stays in its previous mode, because it has not executed the command then."""
    seen = trial.watch.modes
    if trial.takeoff is not None:
        command_s = trial.takeoff.at_s
        has_stayed = not trial.watch.climb.lifted and seen.mode_since_s <= command_s + MODE_KNOWN_S
        has_stayed = has_stayed and seen.mode == trial.takeoff.mode
    elif trial.state is State.ABORT_LAND:
        command_s = trial.since_s
        has_stayed = seen.mode_since_s <= command_s
    else:
        return frozenset()
    if has_stayed or seen.heartbeat_s - command_s < MODE_KNOWN_S:
        return frozenset()
    return _flying_modes(trial) | trial.plan.autopilot.landing_modes


def _flying_modes(trial: Trial) -> frozenset[str]:
    """Return the modes that it may fly in: those in which it follows set points only from the first on, and no others
    once it has confirmed that, until it is commanded to land."""
    autopilot = trial.plan.autopilot
    if not (trial.plan.holds_first and trial.set_points.has_begun):
        return autopilot.flying_modes
    if trial.set_points.changes and trial.state is State.RECORD:
        return autopilot.following_modes
    return autopilot.flying_modes | autopilot.following_modes


def _allowed_blocks(trial: Trial) -> frozenset[str]:
    """Return the blocks of its flight plan that the vehicle may be in. At first it may still report the previous ones,
    and some plans return to them after the landing."""
    autopilot = trial.plan.autopilot
    allowed = autopilot.flying_blocks | autopilot.landing_blocks
    early = trial.takeoff is None or trial.watch.modes.block_s - trial.takeoff.at_s < MODE_KNOWN_S
    return allowed | autopilot.arming_blocks if early or trial.state not in STATES_WITH_TRIAL_GAINS else allowed
