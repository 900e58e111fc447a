"""Registration of vehicles, changes of their settings, and their deletion; placeholders for vehicles of other
installations, which never fly from here.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from typing import Final

from sqlalchemy.orm import Session

from app.accounts.permissions import Permission, RequestContext, require
from app.autopilots.registry import get_experiment
from app.common.conflict_checks import check_action, check_version
from app.common.errors import ConflictError, GainlineError, InputError, Problem, UnconfirmedError
from app.common.schemas import OptionValue
from app.common.states import VEHICLE_ACTIONS, ActKind, VehicleState
from app.core.formatting import EXACT_DIGITS, format_gains, setting_text
from app.core.policy import PolicySpace
from app.db.base import added
from app.db.models import VehicleRow
from app.fleet import repository
from app.fleet.control import record_act, require_may_command, require_not_controlled_by_other
from app.fleet.schemas import NewVehicle, Vehicle, VehicleEdit
from app.fleet.service import (
    is_linked_or_wanted,
    is_registered_one_by_one,
    require_idle,
    settings_of,
    vehicle_view,
)
from app.vehicles.kinds import VehicleKind
from app.vehicles.registry import IMPORT, VEHICLE_KINDS, get_kind

_NAMED: Final = 3
"""Campaigns named in one sentence."""


def register_vehicle(session: Session, new: NewVehicle, context: RequestContext) -> Vehicle:
    """Register a vehicle; it is not connected yet.

    Raises InputError that names everything that cannot be used, ConflictError when only the name is taken,
    UnconfirmedError when only a person's confirmation of a real vehicle's safe gains is missing, NotAllowedError when
    the client may not command it.
    """
    kind = get_kind(new.kind, field="kind")
    if not is_registered_one_by_one(kind):
        raise InputError(
            f"Vehicles of kind {kind.name} need no registration: every campaign can use them.",
            hint=f"Create a campaign with the vehicle {kind.name}.",
            problems=(Problem("kind", "cannot be registered"),),
        )
    require(Permission.LINK, context.caller, new.name)
    refused: list[GainlineError] = []
    options = _accepted_options(kind, new.options, context, refused)
    has_refused_options = bool(refused)
    gains = _accepted_gains(kind, options, new.safe_gains, refused)
    with _noting(refused):
        _require_free(session, new.name)
    is_real = kind.is_real_with(options, context.simulation_hosts)
    if is_real and not has_refused_options:  # with other options it may be a simulation
        if not refused:
            require(Permission.REAL, context.caller, new.name)
        with _noting(refused):
            _require_confirmed(new, gains)
    if len(refused) == 1:
        raise refused[0]
    if refused:
        raise InputError(
            "The vehicle cannot be registered like this.",
            problems=tuple(problem for error in refused for problem in error.problems),
            hint="Correct the fields listed.",
        )
    row = added(
        session,
        VehicleRow(
            kind=kind.name,
            name=new.name,
            title=kind.title,
            is_real=is_real,
            registered=True,
            options=options,
            safe_gains=gains,
            state=VehicleState.DISCONNECTED,
        ),
    )
    record_act(session, row, ActKind.SAFE_GAINS, by="", reason=new.statement or "registered", asked=gains)
    return vehicle_view(row)


@contextmanager
def _noting(refused: list[GainlineError]) -> Iterator[None]:
    """Add a refusal to those before it, so that a client hears of all of them at once."""
    try:
        yield
    except GainlineError as error:
        refused.append(error)


def _accepted_options(
    kind: VehicleKind, asked: Mapping[str, OptionValue], context: RequestContext, refused: list[GainlineError]
) -> dict[str, OptionValue]:
    """The options; after a refusal those that are valid, completed with the defaults."""
    try:
        return kind.check(asked, field="options", simulation_hosts=context.simulation_hosts)
    except InputError as error:
        refused.append(error)
        wrong = {problem.field for problem in error.problems}
        return kind.completed({name: value for name, value in asked.items() if f"options.{name}" not in wrong})


def _accepted_gains(
    kind: VehicleKind,
    options: Mapping[str, OptionValue],
    asked: Mapping[str, float] | None,
    refused: list[GainlineError],
) -> dict[str, float]:
    """The safe gains, or the default ones. With refused options the autopilot may be the wrong one: gains that are not
    its are then not judged."""
    space = _space(kind, options, asked)
    gains = space.mapping(space.default)
    if asked and (not refused or set(asked) == set(space.names)):
        with _noting(refused):
            gains = space.check(asked, field="safe_gains")
    return gains


def edit_vehicle(session: Session, vehicle_id: int, edit: VehicleEdit, context: RequestContext) -> Vehicle:
    """Change a registered vehicle.

    Raises ConflictError when another client changed it first, another operator is in control, or the vehicle's state
    does not allow it; InputError that names what cannot be used; NotAllowedError when the client may not command the
    vehicle.
    """
    row = repository.get_one(session, vehicle_id)
    sent = edit.model_dump(exclude={"version", "statement"}, exclude_none=True)
    differences = {field: (getattr(row, field), value) for field, value in sent.items()}
    by = _require_editable(session, row, edit.version, differences, context)
    if edit.options is not None:
        _set_options(session, row, edit.options, context, by=by)
    if edit.safe_gains is not None:
        _set_safe_gains(session, row, edit.safe_gains, statement=edit.statement, by=by)
    if edit.name is not None and edit.name != row.name:
        _require_free(session, edit.name, unless=row.id)
        row.name = edit.name
    if edit.battery is not None:
        row.battery = edit.battery.strip()
    if edit.model_fields_set > {"version"}:
        row.version += 1
    return vehicle_view(row)


def delete_vehicle(session: Session, vehicle_id: int, version: int, context: RequestContext) -> None:
    """Delete a registered vehicle together with its acts.

    Raises ConflictError while campaigns use it, it is connected or being connected, or it has a concern, and as
    `edit_vehicle` does.
    """
    row = repository.get_one(session, vehicle_id)
    check_version(version, row.version, row.name, {})
    _require_own(row)
    require_may_command(row, context)
    _require_unlinked(row, "it cannot be deleted")
    require_idle(session, row)
    require_not_controlled_by_other(row, context)
    if campaigns := repository.campaign_names(session, row.id):
        raise ConflictError(
            f"{row.name} cannot be deleted: {_listed(campaigns)}.",
            hint="Delete the campaigns that have not flown, or choose another vehicle for them. A vehicle that has "
            "flown a campaign stays registered, because its flights refer to it.",
        )
    repository.delete_acts(session, row.id)
    session.delete(row)


def promote_gains(
    session: Session, row: VehicleRow, gains: Mapping[str, float], *, version: int, reason: str, context: RequestContext
) -> None:
    """Make flown gains the safe gains. Raises ConflictError as `edit_vehicle` does."""
    by = _require_editable(session, row, version, {"safe_gains": (row.safe_gains, dict(gains))}, context)
    _set_safe_gains(session, row, gains, statement=reason, by=by)
    row.version += 1


def _require_editable(
    session: Session,
    row: VehicleRow,
    version: int,
    differences: Mapping[str, tuple[object, object]],
    context: RequestContext,
) -> str:
    """Return the operator of a change of a registered vehicle, as last read in that version. Raises ConflictError,
    BusyError or NotAllowedError as `edit_vehicle` does."""
    check_version(version, row.version, row.name, differences)
    _require_own(row)
    require_may_command(row, context)
    check_action(VEHICLE_ACTIONS, "edit", row.state, row.name)
    require_idle(session, row)
    return require_not_controlled_by_other(row, context)


def _require_own(row: VehicleRow) -> None:
    if not row.registered:
        raise ConflictError(
            f"{row.name} is shared by all campaigns; its settings belong to each campaign.", hint="Edit the campaign."
        )


def _require_unlinked(row: VehicleRow, so: str) -> None:
    """Raise ConflictError unless the vehicle is disconnected for good and free of any concern."""
    if row.concern:
        raise ConflictError(
            f"{row.name} is quarantined: {row.concern} Until it is released, {so}.",
            hint="Connect it, inspect it, then release it.",
        )
    if is_linked_or_wanted(row):
        link = "being connected" if row.state == VehicleState.DISCONNECTED else "connected"
        raise ConflictError(f"{row.name} is {link}; {so}.", hint="Disconnect it first.")


def _listed(campaigns: Sequence[str]) -> str:
    """`the campaign Ladder uses it`, with at most three names."""
    if len(campaigns) == 1:
        return f"the campaign {campaigns[0]} uses it"
    named = ", ".join(campaigns[:_NAMED])
    return f"{len(campaigns)} campaigns use it: {named}{', …' if len(campaigns) > _NAMED else ''}"


def _set_options(
    session: Session, row: VehicleRow, asked: Mapping[str, OptionValue], context: RequestContext, *, by: str
) -> None:
    kind, before = VEHICLE_KINDS[row.kind], settings_of(row)
    options = kind.check({**before, **asked}, field="options", simulation_hosts=context.simulation_hosts)
    if options == before:
        return
    _require_unlinked(row, "its settings cannot be changed")
    if kind.is_real_with(options, context.simulation_hosts) != row.is_real:
        raise InputError(
            f"{row.name} is {'REAL' if row.is_real else 'simulated'}. This cannot be changed, because its flights "
            "are recorded as such.",
            hint="Register the other vehicle separately.",
            problems=(Problem("options", "would change whether the vehicle is real"),),
        )
    _space(kind, options, row.safe_gains).check(row.safe_gains, field="safe_gains")  # another autopilot has other gains
    changed = "; ".join(
        f"{option.label or option.title}: {setting_text(options[option.name], option.unit)}"
        for option in kind.options
        if options[option.name] != before[option.name]
    )
    row.options, row.identity, row.checks, row.checked_at = options, None, None, None
    record_act(session, row, ActKind.SETTINGS, by=by, reason=changed)


def _set_safe_gains(
    session: Session, row: VehicleRow, asked: Mapping[str, float], *, statement: str | None, by: str
) -> None:
    gains = _space(VEHICLE_KINDS[row.kind], row.options, asked).check(asked, field="safe_gains")
    if gains == row.safe_gains:
        return
    if statement is None:
        raise InputError(
            f"Changing the safe gains of {row.name} needs a statement: every flight ends with them.",
            hint="State who decided the change, and from which flights.",
            problems=(Problem("statement", "is missing"),),
        )
    row.safe_gains = gains
    record_act(session, row, ActKind.SAFE_GAINS, by=by, reason=statement, asked=gains)


def _space(kind: VehicleKind, options: Mapping[str, OptionValue], gains: Mapping[str, object] | None) -> PolicySpace:
    """Gain space of the vehicle's experiment that has these gains, or of its first experiment."""
    spaces = [get_experiment(name).space for name in kind.experiments_with(options)]
    return next((space for space in spaces if set(space.names) == set(gains or ())), spaces[0])


def _require_free(session: Session, name: str, *, unless: int | None = None) -> None:
    taken = repository.of_name_or_none(session, name)
    if (taken is not None and taken.id != unless) or any(kind.title == name for kind in VEHICLE_KINDS.values()):
        raise ConflictError(
            f"Another vehicle has the name {name}.",
            hint="Choose another name: every page identifies the vehicle by it.",
            problems=(Problem("name", "is taken"),),
        )


def _require_confirmed(new: NewVehicle, gains: Mapping[str, float]) -> None:
    required = (
        (
            new.safe_gains_confirmed,
            "safe_gains_confirmed",
            "must be confirmed by the person who verified the safe gains",
        ),
        (new.statement.strip(), "statement", "must state who verified them, and how"),
    )
    if problems := tuple(Problem(field, reason) for is_given, field, reason in required if not is_given):
        raise UnconfirmedError(
            f"{new.name} is a real vehicle, and each of its flights ends with "
            f"{format_gains(gains, EXACT_DIGITS)}. A person must review these gains first.",
            hint="Compare them with gains that fly well on this vehicle, then confirm them and give your name.",
            problems=problems,
        )


_ROOM: Final = 90
_KIND: Final = "origin"
_NAME: Final = "origin_name"


def get_or_create_imported_vehicle(
    session: Session, *, name: str, kind: str, is_real: bool, safe_gains: Mapping[str, float]
) -> VehicleRow:
    """Return the placeholder for a vehicle of that name and kind; create it if there is none.

    Its kind is `import`, so that it cannot be flown, and it has no ledger, because no gains were sent to it from here.
    """
    origin: dict[str, OptionValue] = {_KIND: kind, _NAME: name}
    for number in count(1):
        called = f"{name[:_ROOM]} (elsewhere{'' if number == 1 else f', {number}'})"
        known = repository.of_name_or_none(session, called)
        if known is None:
            return added(
                session,
                VehicleRow(
                    kind=IMPORT.name,
                    name=called,
                    title=IMPORT.title,
                    is_real=is_real,
                    options=origin,
                    safe_gains=dict(safe_gains),
                    state=VehicleState.DISCONNECTED,
                ),
            )
        if (known.kind, known.registered, known.is_real, known.options) == (IMPORT.name, False, is_real, origin):
            return known
    raise AssertionError("unreachable")


def origin_of(row: VehicleRow) -> tuple[str, str] | None:
    """Kind and name of the vehicle that a placeholder stands for; None for a vehicle of this installation."""
    if row.registered or _KIND not in row.options:
        return None
    return str(row.options[_KIND]), str(row.options[_NAME])
