"""Kinds of vehicle: description, options, and how a vehicle is opened."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.core.definition import Option, with_defaults
from app.core.errors import InputError, Problem
from app.core.policy import Gains
from app.vehicles.base import ConnectedVehicle, Identity, OptionValue, Vehicle

Options = Mapping[str, OptionValue]
Hosts = frozenset[str]
"""Hosts besides this computer on which simulations run, as configured by the administrator."""

HERE: Final[Hosts] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleKind:
    """A registered kind of vehicle.

    `experiments` are the experiments that it can fly; `experiments_for(options)` those with these options, if that
    depends on them.
    `open(options, safe_gains, trial_parameters)` receives complete, checked options and returns a vehicle that holds
    its safe gains.
    `connect(options, safe_gains, trial_parameters, identity, on_wait, was_flying)` opens a link that stays open between
    flights; None: vehicles of this kind are opened for each flight. `on_wait` is called at least twice a second while
    waiting for the vehicle on the ground; an exception from it ends the operation. `connect` raises VehicleError if no
    vehicle answers, or one other than `identity` (None: any vehicle). An armed vehicle is returned with its `concern`
    set, and no gains are written to it; one that `was_flying` when an earlier process ended is commanded to land.
    In the folder `trial_parameters` both keep the parameters that a trial changes in addition to the gains, so that
    they are restored even if this process dies.
    `find_conflicts(options, hosts)` names options whose text cannot be used, or that are valid one by one but not
    together; where an option is refused for its type or range, it receives the default;
    `is_simulation(options, hosts)` returns whether a vehicle of a real kind is a simulation.
    `check_gains(options, gains)` raises GainsError for gains that are never written to such a vehicle, even if a person
    overrules the gate. `longest_window_s(options)` is the longest window, s, that such a vehicle can fly.
    `altitude_limit_m` is the height above the ground at which its flight is aborted; None if there is no such limit.
    `highest_set_point_m` is the highest altitude that it is commanded to fly to.
    """

    name: str
    title: str
    line: str
    is_real: bool
    experiments: tuple[str, ...]
    options: tuple[Option, ...]
    open: Callable[[Options, Gains, Path | None], Vehicle]
    connect: Callable[[Options, Gains, Path, Identity | None, Callable[[], None], bool], ConnectedVehicle] | None = None
    find_conflicts: Callable[[Options, Hosts], tuple[Problem, ...]] = lambda _options, _hosts: ()
    is_simulation: Callable[[Options, Hosts], bool] = lambda _options, _hosts: False
    experiments_for: Callable[[Options], tuple[str, ...]] | None = None
    check_gains: Callable[[Options, Gains], object] = lambda _options, _gains: None
    longest_window_s: Callable[[Options], float] = lambda _options: math.inf
    can_fly: bool = True
    altitude_limit_m: float | None = None
    highest_set_point_m: float = math.inf

    def experiments_with(self, options: Options) -> tuple[str, ...]:
        """Experiments that a vehicle with these complete, checked options can fly; the first is the default."""
        return self.experiments if self.experiments_for is None else self.experiments_for(options)

    def is_real_with(self, options: Options, simulation_hosts: Hosts = HERE) -> bool:
        """Whether a vehicle with these complete, checked options is REAL."""
        return self.is_real and not self.is_simulation(options, simulation_hosts)

    def completed(self, options: Options) -> dict[str, OptionValue]:
        """Complete options stored by another version: add new ones at their defaults, drop unknown ones."""
        return with_defaults(options, self.options)

    def check(
        self, options: Mapping[str, object], *, field: str, simulation_hosts: Hosts = HERE
    ) -> dict[str, OptionValue]:
        """Return the options completed with the defaults. Raises InputError naming every unknown or invalid one."""
        known = {option.name: option for option in self.options}
        names = ", ".join(known) or "none"
        problems = [
            Problem(f"{field}.{name}", f"is not an option of {self.name} ({names})")
            for name in options
            if name not in known
        ]
        complete: dict[str, OptionValue] = {}
        for name, option in known.items():
            value, reason = _accept(option, options.get(name, option.default))
            complete[name] = value
            if reason:
                problems.append(Problem(f"{field}.{name}", reason))
        refused = {problem.field for problem in problems}
        conflicts = [Problem(f"{field}.{p.field}", p.reason) for p in self.find_conflicts(complete, simulation_hosts)]
        problems += [problem for problem in conflicts if problem.field not in refused]
        if problems:
            raise InputError(
                f"These options cannot be used with the vehicle {self.name}.",
                problems=tuple(problems),
                hint="Correct the options listed.",
                script_hint="Correct the options listed, or omit them to use their defaults.",
            )
        return complete


def _accept(option: Option, value: object) -> tuple[OptionValue, str | None]:
    """Return `value` in the type of the option's default, and the reason if it is invalid."""
    default = option.default
    if isinstance(default, bool | str):
        expected = "must be true or false" if isinstance(default, bool) else "must be text"
        fits = isinstance(value, type(default))
        return (value, None) if isinstance(value, bool | str) and fits else (default, expected)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return default, f"must be a number, got {value!r}"
    reason = option.refusal(value)
    return (float(value), None) if reason is None else (default, reason)
