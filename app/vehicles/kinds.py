"""What a kind of vehicle is: its description, its settings, and how one is opened."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.core.errors import InputError, Problem
from app.core.policy import Gains, is_finite, shortened
from app.vehicles.base import ConnectedVehicle, Identity, OptionValue, Vehicle, VehicleOption

Options = Mapping[str, OptionValue]
Hosts = frozenset[str]
"""Beyond this computer, hosts on which the administrator says that simulations run."""

HERE: Final[Hosts] = frozenset()


def _no_conflicts(_options: Options, _simulation_hosts: Hosts) -> tuple[Problem, ...]:
    return ()


def _never(_options: Options, _simulation_hosts: Hosts) -> bool:
    return False


def _accept_any_gains(_options: Options, _gains: Gains) -> None:
    """A simulation flies whatever its controller can hold."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleKind:
    """A registered kind of vehicle.

    `experiments` names those that it can fly; where that depends on its settings, `suits(options)` those that it can
    fly with these. `open(options, safe_gains, trial_parameters)` gets complete, checked options and returns a vehicle
    that holds its safe gains. `connect(options, safe_gains, identity, trial_parameters, on_wait)` opens a link that
    stays open between flights; None: the kind has none, and is opened for each flight. `on_wait` is called twice a
    second at least while the vehicle is waited for on the ground; what it raises ends what is under way. `connect`
    raises VehicleError when nobody answers, or another than `identity` (None: whoever answers); an armed vehicle is
    returned, with nothing written to it and its `concern` set. In the folder `trial_parameters` either keeps what a
    trial changes beside the gains, which is put back even if this process dies.
    `conflicts(options, hosts)` names options that are possible one by one but not together; `simulates(options, hosts)`
    says whether a vehicle of a real kind is a simulation all the same. `check_gains(options, gains)` raises GainsError
    for gains that such a vehicle is never given, whatever anybody overrules.
    """

    name: str
    title: str
    line: str
    is_real: bool
    can_fly: bool
    experiments: tuple[str, ...]
    options: tuple[VehicleOption, ...]
    open: Callable[[Options, Gains, Path | None], Vehicle]
    connect: Callable[[Options, Gains, Identity | None, Path, Callable[[], None]], ConnectedVehicle] | None = None
    find_conflicts: Callable[[Options, Hosts], tuple[Problem, ...]] = _no_conflicts
    is_simulation: Callable[[Options, Hosts], bool] = _never
    experiments_for: Callable[[Options], tuple[str, ...]] | None = None
    check_gains: Callable[[Options, Gains], None] = _accept_any_gains

    def experiments_with(self, options: Options) -> tuple[str, ...]:
        """Those that a vehicle with these options, complete and checked, can fly; the first is its usual one."""
        return self.experiments if self.experiments_for is None else self.experiments_for(options)

    def is_real_with(self, options: Options, simulation_hosts: Hosts = HERE) -> bool:
        """Whether a vehicle with these options, complete and checked, is REAL."""
        return self.is_real and not self.is_simulation(options, simulation_hosts)

    def completed(self, options: Options) -> dict[str, OptionValue]:
        """Options as any version of the program stored them: later ones at their defaults, none that are gone."""
        return {option.name: options.get(option.name, option.default) for option in self.options}

    def check(
        self, options: Mapping[str, object], *, field: str, simulation_hosts: Hosts = HERE
    ) -> dict[str, OptionValue]:
        """The options completed with the defaults. Raises InputError naming every unknown or impossible one."""
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
        if not problems:
            problems = [
                Problem(f"{field}.{p.field}", p.reason) for p in self.find_conflicts(complete, simulation_hosts)
            ]
        if problems:
            raise InputError(
                f"These options do not suit the vehicle {self.name}.",
                problems=tuple(problems),
                hint="Correct the named options, or leave them out to get their defaults.",
            )
        return complete


def _accept(option: VehicleOption, value: object) -> tuple[OptionValue, str | None]:
    """`value` in the type of the option's default, and why it cannot be used, if so."""
    default = option.default
    if isinstance(default, bool | str):
        fits = isinstance(value, type(default))
        return (value, None) if isinstance(value, bool | str) and fits else (default, _expected(default))
    if isinstance(value, bool) or not isinstance(value, int | float):
        return default, f"must be a number, got {value!r}"
    if not is_finite(value):
        return default, f"must be a finite number, got {shortened(value)}"
    low, high = option.lower, option.upper
    if (low is not None and value < low) or (high is not None and value > high):
        return default, f"must lie in {_edge(low)} … {_edge(high)} {option.unit}, got {value:g}"
    return float(value), None


def _expected(default: bool | str) -> str:
    return "must be true or false" if isinstance(default, bool) else "must be a text"


def _edge(limit: float | None) -> str:
    return "any" if limit is None else f"{limit:g}"
