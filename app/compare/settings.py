"""Settings of a flight, and the differences between several flights."""

from collections.abc import Iterable, Mapping, Sequence

from app.common.schemas import OptionValue
from app.compare.schemas import FlightDifference, FlightSetting
from app.compare.sides import ComparisonFlight
from app.core.experiments import get_experiment
from app.core.options import Option
from app.core.strategies import STRATEGIES
from app.db.models import CampaignRow
from app.fleet import service as fleet
from app.vehicles.base import VehicleOption
from app.vehicles.open import VEHICLE_KINDS


def settings_of(side: ComparisonFlight, battery: str) -> list[FlightSetting]:
    """Vehicle, experiment and strategy with their settings, the battery, and other recorded settings of a flight."""
    row, campaign = side.row, side.campaign
    kind = VEHICLE_KINDS.get(campaign.vehicle.kind)
    strategy = STRATEGIES[campaign.strategy]
    options = fleet.options_of(campaign)
    found = [
        FlightSetting(title="Vehicle", unit="", value=campaign.vehicle.title),
        *_options(options, () if kind is None else kind.options),
        FlightSetting(title="Experiment", unit="", value=side.experiment.title),
        *_options(campaign.definition["experiment_options"], get_experiment(campaign.experiment).options),
        FlightSetting(title="Strategy", unit="", value=strategy.title),
        *_options(campaign.definition["options"], strategy.options),
        FlightSetting(title="Seed of the campaign", unit="", value=_seed(campaign)),
    ]
    if battery:
        found.append(FlightSetting(title="Battery", unit="", value=battery))
    if row.landing_battery_v is not None:
        found.append(FlightSetting(title="Battery after landing", unit="V", value=round(row.landing_battery_v, 2)))
    said = row.settings.items() - options.items()
    return found + [FlightSetting(title=name, unit="", value=value) for name, value in sorted(said)]


def setting_differences(flights: Sequence[Sequence[FlightSetting]]) -> list[FlightDifference]:
    """The settings that are not the same in all flights; None for a flight without that setting."""
    titles = dict.fromkeys((one.title, one.unit) for settings in flights for one in settings)
    values = [{(one.title, one.unit): one.value for one in settings} for settings in flights]
    return _differing((title, unit, [own.get((title, unit)) for own in values]) for title, unit in titles)


def gain_differences(sides: Sequence[ComparisonFlight]) -> list[FlightDifference]:
    """The gains that are not the same in all flights."""
    known = {gain.name: gain for side in sides for gain in side.experiment.space.gains}
    names = dict.fromkeys(name for side in sides for name in side.row.gains)
    return _differing(
        (name, known[name].unit if name in known else "", [side.row.gains.get(name) for side in sides])
        for name in names
    )


def _seed(campaign: CampaignRow) -> str:
    """As text, because the difference between two seeds has no meaning."""
    return str(campaign.definition["seed"])


def _options(
    values: Mapping[str, OptionValue], known: Iterable[Option] | Iterable[VehicleOption]
) -> list[FlightSetting]:
    described = {option.name: option for option in known}
    return [
        FlightSetting(
            title=described[name].title if name in described else name,
            unit=described[name].unit if name in described else "",
            value=value,
        )
        for name, value in values.items()
    ]


def _differing(rows: Iterable[tuple[str, str, list[OptionValue | None]]]) -> list[FlightDifference]:
    return [
        FlightDifference(title=title, unit=unit, values=values, changes=[_change(values[0], one) for one in values])
        for title, unit, values in rows
        if any(one != values[0] for one in values)
    ]


def _change(first: OptionValue | None, value: OptionValue | None) -> int | float | None:
    if any(one is None or isinstance(one, bool | str) for one in (first, value)):
        return None
    assert isinstance(first, int | float)
    assert isinstance(value, int | float)
    return value - first
