"""Vehicles as campaigns and flights use them: which vehicle, what it can do, by its kind, and its state.

Registration is in `registration`, requests beside flights in `commands`, operators' leases in `control`, what was
asked of a vehicle in `views`.
"""

from collections.abc import Mapping
from datetime import datetime
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.autopilots.registry import offered
from app.common.conflict_checks import allowed, check_action, check_transition
from app.common.errors import BusyError, ConflictError, InputError, Problem
from app.common.schemas import OptionValue, Page
from app.common.states import VEHICLE_ACTIONS, VEHICLE_TRANSITIONS, ActKind, VehicleState
from app.core.policy import Gains
from app.db.base import added, utc_now
from app.db.models import CampaignRow, VehicleActRow, VehicleRow
from app.db.pages import Order, Part, page_of
from app.figures.vehicle_history import BatteryFlight
from app.fleet import repository
from app.fleet.control import control_of
from app.fleet.schemas import CampaignVehicle, Vehicle, VehicleChoice
from app.vehicles.kinds import VehicleKind
from app.vehicles.registry import VEHICLE_KINDS, get_kind


def can_fly(row: VehicleRow) -> bool:
    """Whether the program can fly it, rather than import records of flights flown elsewhere."""
    return VEHICLE_KINDS[row.kind].can_fly


def experiments_of(row: VehicleRow) -> list[str]:
    """Experiments whose gains the vehicle has; for a shared vehicle, all that its kind can fly."""
    kind = VEHICLE_KINDS[row.kind]
    return list(kind.experiments_with(row.options) if row.registered else kind.experiments)


def settings_of(row: VehicleRow) -> dict[str, OptionValue]:
    """The settings of a registered vehicle, with defaults filled in."""
    return VEHICLE_KINDS[row.kind].completed(row.options)


def is_registered_one_by_one(kind: VehicleKind) -> bool:
    """Whether each vehicle of the kind has its own row, settings and link, rather than one shared by all campaigns.

    True for kinds that include real vehicles and that the program flies.
    """
    return kind.is_real and kind.can_fly


def needs_staging(row: VehicleRow) -> bool:
    """Whether a person's own act is required between staging and takeoff: the vehicle is real and registered."""
    return row.is_real and row.registered


def chosen_vehicle(session: Session, choice: VehicleChoice, *, default_gains: Gains) -> VehicleRow:
    """The registered vehicle with the chosen id, or the shared one of a kind, created at its first use.

    `default_gains` are the experiment's. Raises InputError when there is no such vehicle, or when its gains are not
    those of the experiment.
    """
    if choice.id is not None:
        return _registered(session, choice, choice.id, default_gains)
    described = get_kind(choice.kind)
    if is_registered_one_by_one(described):
        raise _no_choice("id", "is missing: a vehicle of this kind must be registered first")
    if (known := repository.shared_of_kind_or_none(session, choice.kind)) is not None:
        return known
    return added(
        session,
        VehicleRow(
            kind=choice.kind,
            name=described.title,
            title=described.title,
            is_real=described.is_real,
            safe_gains=dict(default_gains),
            state=VehicleState.READY if described.can_fly else VehicleState.DISCONNECTED,
        ),
    )


def _registered(session: Session, choice: VehicleChoice, vehicle_id: int, default_gains: Gains) -> VehicleRow:
    row = session.get(VehicleRow, vehicle_id)
    if row is None or not row.registered:
        raise _no_choice("id", f"there is no registered vehicle {vehicle_id}")
    if row.kind != choice.kind:
        raise _no_choice("kind", f"{row.name} is of kind {row.kind}")
    if choice.options and choice.options != row.options:
        raise _no_choice("options", f"are those with which {row.name} is registered; change them there")
    if row.safe_gains.keys() != default_gains.keys():
        ours, its = ", ".join(default_gains), ", ".join(row.safe_gains)
        raise _no_choice("id", f"{row.name} has the gains {its}; this experiment tunes {ours}")
    return row


def simulation_for(session: Session, experiment: str, gains: Gains) -> VehicleChoice | None:
    """Simulation that can fly an experiment.

    A simulation shared by campaigns, in the order of VEHICLE_KINDS (the most detailed first); else a registered vehicle
    that is simulated and has the same `gains`, a connected one first. None when there is none.
    """
    for kind in VEHICLE_KINDS.values():
        if kind.can_fly and not kind.is_real and experiment in kind.experiments:
            return VehicleChoice(kind=kind.name)
    simulated = [
        row
        for row in repository.registered_in(session, *VehicleState)
        if not row.is_real and experiment in experiments_of(row) and row.safe_gains.keys() == gains.keys()
    ]
    found = min(simulated, key=lambda row: (row.state == VehicleState.DISCONNECTED, row.id), default=None)
    return None if found is None else VehicleChoice(kind=found.kind, id=found.id)


def registered_for(session: Session, experiment: str, vehicle_id: int | None) -> VehicleChoice:
    """The registered vehicle with that id; without one, the only registered one that flies an experiment. Raises
    InputError when there is none, or there are several."""
    if vehicle_id is not None:
        row = session.get(VehicleRow, vehicle_id)
        if row is None:
            raise _no_vehicle(f"{vehicle_id} is not registered", hint="Choose a registered vehicle.")
        return VehicleChoice(kind=row.kind, id=row.id)
    flying = [row for row in repository.registered_in(session, *VehicleState) if experiment in experiments_of(row)]
    if not flying:
        raise _no_vehicle(
            f"no registered vehicle flies {experiment!r}", hint="Register the vehicle of the log on the Vehicles page."
        )
    if len(flying) > 1:
        names = ", ".join(f"{row.name} ({row.id})" for row in flying)
        raise _no_vehicle(f"must be given: {names} fly {experiment!r}", hint="Choose the vehicle of the log.")
    return VehicleChoice(kind=flying[0].kind, id=flying[0].id)


def _no_vehicle(reason: str, *, hint: str) -> InputError:
    return InputError("Invalid vehicle.", problems=(Problem("vehicle", reason),), hint=hint)


def _no_choice(field: str, reason: str) -> InputError:
    return InputError(
        "Invalid vehicle.",
        problems=(Problem(f"vehicle.{field}", reason),),
        hint="Register the vehicle on the Vehicles page, then choose it for the campaign.",
        script_hint="Register the vehicle with POST /api/vehicles and give its `id`.",
    )


def require_ready(session: Session, row: VehicleRow, action: str) -> None:
    """Raise ConflictError when the vehicle's state does not allow `fly` or `stage`, BusyError while it is busy."""
    if not can_fly(row):
        raise ConflictError(
            f"{row.name} cannot be flown from here.",
            hint="Fly it elsewhere, then upload the flight record to the planned trial.",
        )
    if row.state == VehicleState.QUARANTINED:
        raise ConflictError(
            f"{row.name} is quarantined: {row.concern}", hint="Inspect the vehicle, verify its gains, then release it."
        )
    if row.state == VehicleState.DISCONNECTED:
        raise ConflictError(f"{row.name} is not connected.", hint="Connect it on its page, then try again.")
    check_action(VEHICLE_ACTIONS, action, row.state, row.name)
    require_idle(session, row)


def require_window_fits(row: VehicleRow, window_s: float) -> None:
    """Raise ConflictError when the vehicle cannot fly for as long as the scored window needs."""
    settings = settings_of(row)
    longest_s = get_kind(row.kind).longest_window_s(settings)
    if window_s > longest_s:
        needed_s = float(settings["plan_time_s"]) + window_s - longest_s
        raise ConflictError(
            f"{row.name} can fly a scored window of at most {longest_s:g} s; the campaign's is {window_s:g} s. Its "
            "flight plan would land it before the end.",
            hint="Choose a shorter window; or raise the time limit of Takeoff in its flight plan, then the vehicle's "
            f"setting “Paparazzi: time limit of the flight plan's takeoff” (plan_time_s), to {needed_s:g} s or more.",
        )


_ACTS: Final[Mapping[str, str]] = {
    ActKind.CONNECT: "it is being connected",
    ActKind.DISCONNECT: "it is being disconnected",
    ActKind.CHECK: "its gains are being checked",
    ActKind.RESTORE: "its safe gains are being restored",
    ActKind.PARAMETERS: "its parameters are being read",
    ActKind.RELEASE: "it is being released",
}


def require_idle(session: Session, row: VehicleRow) -> None:
    """Raise BusyError while the vehicle has a flight or an act under way, because requests do not queue."""
    if (flight := repository.flight_under_way(session, row.id)) is not None:
        raise BusyError(
            f"{row.name} already has a flight: flight {flight.trial.number} of campaign {flight.campaign_id}.",
            hint="Wait until it has landed, or abort it; flights do not queue.",
        )
    if (act := repository.act_under_way(session, row.id)) is not None:
        raise BusyError(f"{row.name} is busy: {_ACTS[act.kind]}.", hint="Wait until that has finished.")


def set_vehicle_state(row: VehicleRow, to: VehicleState) -> None:
    """Change a vehicle's state. Raises ConflictError when the transition is not in the table."""
    row.state = check_transition(VEHICLE_TRANSITIONS, row.state, to, row.name)


def set_state_after_flight(row: VehicleRow, *, concern: str = "") -> None:
    """Set the state after a flight, however it ended: ready, or quarantined when there is a concern."""
    if concern:
        row.concern = concern
    target = VehicleState.QUARANTINED if concern else VehicleState.READY
    if row.state not in {target, VehicleState.QUARANTINED}:
        set_vehicle_state(row, target)


def hold_gains(row: VehicleRow, held: Mapping[str, float]) -> None:
    """Record the gains that the vehicle reported."""
    row.held, row.held_at = dict(held), utc_now()


def doubt_gains(row: VehicleRow) -> None:
    """Quarantine a real vehicle after a flight that ended without a report that the safe gains are restored. A
    simulated vehicle starts afresh with every flight."""
    if row.is_real:
        row.held = row.held_at = None
        set_state_after_flight(row, concern="Its process ended before the safe gains were read back after the flight.")


def is_classed_automatically(row: VehicleRow) -> bool:
    """Whether a complete flight counts without a review: simulated flights do, and imported records."""
    return not row.is_real or not can_fly(row)


def is_linked_or_wanted(row: VehicleRow) -> bool:
    return row.state != VehicleState.DISCONNECTED or row.wanted_connected


def _actions(row: VehicleRow) -> list[str]:
    is_linked = is_linked_or_wanted(row)
    return allowed(
        VEHICLE_ACTIONS,
        row.state,
        (
            (not row.registered, VEHICLE_ACTIONS.keys() - {"fly", "release"}),
            (not can_fly(row), {"fly", "stage"}),
            (needs_staging(row), {"fly"}),
            (not is_linked, {"disconnect"}),
            (is_linked or row.concern, {"configure", "delete"}),
        ),
    )


def vehicle_view(row: VehicleRow) -> Vehicle:
    return Vehicle.view_of(
        row,
        can_fly=can_fly(row),
        experiments=offered(experiments_of(row)),
        options=settings_of(row) if row.registered else row.options,
        control=control_of(row),
        actions=_actions(row),
    )


def campaign_vehicle(row: CampaignRow) -> CampaignVehicle:
    """A campaign's vehicle with its settings."""
    vehicle = row.vehicle
    return CampaignVehicle.view_of(
        vehicle, can_fly=can_fly(vehicle), needs_staging=needs_staging(vehicle), options=options_of(row)
    )


def options_of(row: CampaignRow) -> dict[str, OptionValue]:
    """The settings that a campaign flies with: a registered vehicle's own, else the campaign's."""
    return settings_of(row.vehicle) if row.vehicle.registered else dict(row.vehicle_options)


def list_vehicles(session: Session, part: Part) -> Page[Vehicle]:
    """Page of vehicles in the order in which they were registered or first used."""
    by_id = Order("id", VehicleRow.id.expression)
    return page_of(session, select(VehicleRow), by_id, part, lambda rows: [vehicle_view(row) for row in rows])


def name_of_hardware(session: Session, hardware_id: str) -> str | None:
    """Name of the registered vehicle with this hardware id, if there is one alone."""
    rows = repository.registered_in(session, *VehicleState) if hardware_id else []
    names = [row.name for row in rows if (row.identity or {}).get("uid") == hardware_id]
    return names[0] if len(names) == 1 else None


def get_vehicle(session: Session, vehicle_id: int) -> Vehicle:
    """The vehicle with that id. Raises NotFoundError."""
    return vehicle_view(repository.get_one(session, vehicle_id))


def battery_flights(session: Session, vehicle_id: int) -> list[BatteryFlight]:
    """Battery readings before and after each flight, oldest first."""
    return [
        BatteryFlight(flight=place, battery=row.battery, before_v=row.battery_v_before, after_v=row.battery_v_after)
        for place, row in enumerate(repository.flights_of(session, vehicle_id), start=1)
    ]


def safe_gains_changes(session: Session, vehicle_id: int) -> list[datetime]:
    """Times at which the safe gains were set, oldest first."""
    wanted = repository.acts_of(vehicle_id).where(VehicleActRow.kind == ActKind.SAFE_GAINS)
    return [row.requested_at for row in session.scalars(wanted.order_by(VehicleActRow.id))]
