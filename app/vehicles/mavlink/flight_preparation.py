"""Preparation of a flight with its options: set points, parameters, requirements, the plan of its trial."""

import numpy as np

from app.autopilots.commands import Setting
from app.vehicles.base import CheckItem, FlightOptions
from app.vehicles.kinds import Options
from app.vehicles.mavlink import parameters, preflight
from app.vehicles.mavlink.command_sequence import set_up
from app.vehicles.mavlink.ground_observation import GroundObservation
from app.vehicles.mavlink.parameters import GainStore
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.radio import AutopilotLink
from app.vehicles.mavlink.records import Reference, simulate_reference
from app.vehicles.mavlink.set_point_schedule import with_hold


def flies_steps(order: FlightOptions) -> bool:
    """Whether set points follow the takeoff's."""
    return len(order.set_points.times_s) > 1


def prepare_set_points(radio: AutopilotLink, release: int) -> dict[str, float]:
    """Request the telemetry that a flight with several set points needs, and return the parameters of its loop, which
    the replica would otherwise replace by defaults; `release` is the place of the vehicle's gains among the sets."""
    profile = radio.profile
    set_up(radio, tuple(each.step(radio.target) for each in profile.set_point_telemetry))
    if not profile.loop_parameters:
        return {}
    return parameters.read_loop(radio, profile.loop_parameters[release], profile.may_lack)


def settings_of(order: FlightOptions, radio: AutopilotLink) -> tuple[Setting, ...]:
    """Return the parameters that the flight needs."""
    profile, target = radio.profile, radio.target
    settings = profile.take_off_settings(target)
    return (*settings, *profile.set_point_settings) if flies_steps(order) else settings


def evaluate_time(order: FlightOptions, radio: AutopilotLink, options: Options) -> tuple[CheckItem, ...]:
    """Check that the flight fits the vehicle's flight plan, if it has one."""
    if not radio.profile.flying_blocks:
        return ()
    return (preflight.evaluate_flight_time(order.record_s, plan_time_s=float(options["plan_time_s"])),)


def reference_of(order: FlightOptions, radio: AutopilotLink, ground_m: float) -> Reference | None:
    """Return the function that computes the autopilot's own reference; None if it sends that, or if it is not
    needed."""
    if not flies_steps(order) or radio.profile.reference != "replica":
        return None
    return lambda set_points, time_s: simulate_reference(set_points, ground_m, time_s, order.record_s)


def compile_reference(order: FlightOptions, radio: AutopilotLink) -> None:
    """Compute a reference once: the first computation may take seconds, which must not pass after the ground was
    observed."""
    if (reference := reference_of(order, radio, 0.0)) is not None:
        reference(order.set_points, np.zeros(1))


def plan_of(
    order: FlightOptions, ground: GroundObservation, radio: AutopilotLink, options: Options, gains: GainStore
) -> Plan:
    """Return the plan of a flight from there, with the set points of the order."""
    holds = flies_steps(order) and radio.profile.holds_first
    plan = Plan(
        autopilot=radio.profile,
        safe_gains=gains.safe_settings,
        trial_gains=gains.staged_settings,
        blocks={number: name for name, number in radio.target.blocks.items()},
        ground_m=0.0,
        set_point_m=radio.target.altitude_m,
        set_points=with_hold(order.set_points) if holds else order.set_points,
        record_s=order.record_s,
        min_battery_v=float(options["min_battery_v"]),
        radius_m=float(options["radius_m"]),
        timeout_factor=radio.timeout_factor,
    )
    return plan.on_ground_at(ground.altitude_m)
