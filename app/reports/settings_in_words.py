"""A campaign's frozen settings, as titles and values: what was tuned, and how."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, Protocol

from app.campaigns.schemas import Campaign, Start, StopRule
from app.core.definition import OptionValue
from app.core.experiments import EXPERIMENTS
from app.core.experiments.base import Experiment
from app.core.strategies import STRATEGIES
from app.fleet.schemas import Identity
from app.reports.content import Fact
from app.reports.wording import count, gain, gains, option, percent
from app.vehicles.open import VEHICLE_KINDS

_STARTS: Final = {
    "default": "the vehicle's default gains",
    "simplex": "the optimum of the simple model (simplex)",
    "given": "given gains",
    "campaign": "the best of another campaign",
}


class _Described(Protocol):
    """A setting of an experiment, a strategy or a vehicle."""

    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def unit(self) -> str: ...


def describe_vehicle(campaign: Campaign, experiment: Experiment, identity: Identity | None) -> tuple[Fact, ...]:
    """The vehicle, REAL or simulated, with its settings, and the experiment with its gains."""
    vehicle = campaign.vehicle
    kind = VEHICLE_KINDS.get(vehicle.kind)
    facts = [
        Fact("Vehicle", vehicle.name if vehicle.name == vehicle.title else f"{vehicle.name} ({vehicle.title})"),
        Fact("Real or simulated", "REAL" if vehicle.is_real else "SIM: a simulation, nothing left the ground"),
    ]
    if identity is not None:
        known = f"{identity.autopilot} {identity.version}".strip()
        hardware = f", hardware id {identity.uid}" if identity.uid else ""
        facts.append(Fact("Autopilot", f"{known}, system {identity.system_id}{hardware}"))
    facts += _options(vehicle.options, () if kind is None else kind.options)
    facts.append(Fact("Experiment", experiment.title))
    facts += _options(campaign.definition.experiment_options, experiment.options)
    facts += [
        Fact(
            f"Gain {each.name}",
            f"{each.title}{f' ({each.unit})' if each.unit else ''}, {gain(each.lower)} … {gain(each.upper)}",
        )
        for each in experiment.space.gains
    ]
    return tuple(facts)


def describe_method(campaign: Campaign, experiment: Experiment) -> tuple[Fact, ...]:
    """Strategy, start, bounds and stop rule, each with its settings."""
    definition = campaign.definition
    strategy = STRATEGIES.get(definition.strategy)
    facts = [Fact("Strategy", definition.strategy if strategy is None else strategy.title)]
    facts += _options(definition.options, () if strategy is None else strategy.options)
    facts.append(Fact("Start", _start(definition.start)))
    facts += [
        Fact(f"Bounds of {name}", f"{gain(low)} … {gain(high)}") for name, (low, high) in definition.bounds.items()
    ]
    first, later = percent(definition.first_step_fraction), percent(definition.step_fraction)
    facts.append(Fact("Largest step", f"{first} of each gain's range until a flight is valid, then {later}"))
    if experiment.output == "altitude_m":
        facts.append(Fact("Ceiling of the gate", f"{definition.ceiling_m:g} m"))
    facts.append(Fact("Stop rule", _stop(definition.stop)))
    facts.append(Fact("Seed", str(definition.seed)))
    return tuple(facts)


def experiment_of(campaign: Campaign) -> Experiment:
    """The campaign's experiment with its settings."""
    return EXPERIMENTS[campaign.definition.experiment].configured(campaign.definition.experiment_options)


def _options(chosen: Mapping[str, OptionValue], known: Iterable[_Described]) -> Iterator[Fact]:
    described = {each.name: each for each in known}
    for name, value in chosen.items():
        found = described.get(name)
        if value != "":
            yield Fact(name, option(value)) if found is None else Fact(found.title, option(value, found.unit))


def _start(start: Start) -> str:
    words = _STARTS[start.kind]
    if start.donor is not None:
        words = f"flight {start.donor.trial_number} of campaign {start.donor.campaign_id}"
    return words if start.gains is None else f"{words}: {gains(start.gains)}"


def _stop(stop: StopRule) -> str:
    most = f"at most {count(stop.max_flights, 'flight')}"
    match stop.kind:
        case "paper":
            said = f"two flights in a row less than {percent(stop.improvement)} better than the best; {most}"
        case "noise":
            sure = percent(stop.confidence)
            said = f"nothing left that flights could tell from noise with {sure} confidence; {most}"
        case _:
            said = most
    return said if stop.min_battery_v is None else f"{said}; or a flight that ends below {stop.min_battery_v:g} V"
