"""API views of flight comparisons."""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from app.campaigns.trials.schemas import GroupBrief
from app.common.schemas import Gains, OptionValue, Schema
from app.common.states import TrialState
from app.core.statistics.comparisons import Verdict
from app.core.statistics.pairs import Basis


class FlightSetting(Schema):
    """A setting with which a flight was flown."""

    title: str
    unit: str
    value: OptionValue


class ComparedFlight(Schema):
    """One of the flights.

    `label` is its letter in the figure, `name` its name in sentences; `group` is the mean of all valid flights with its
    gains in its campaign, `scatter` the standard deviation of one such flight, null while it is not known.
    """

    trial_id: int
    label: str
    name: str
    number: int
    campaign_id: int
    campaign_name: str
    vehicle: str
    is_real: bool
    experiment: str
    state: TrialState
    gains: Gains
    error: float | None
    group: GroupBrief | None
    scatter: float | None
    rise_time_s: float | None
    settling_time_s: float | None
    overshoot_m: float | None
    steady_state_error_m: float | None
    flown_at: datetime | None
    settings: list[FlightSetting]


class FlightDifference(Schema):
    """A gain or setting that is not the same in all flights.

    `values` are in the order of the flights, null if a flight does not have it; `changes` are relative to the first
    flight's value, if both are numbers.
    """

    title: str
    unit: str
    values: list[OptionValue | None]
    changes: list[int | float | None]


class FurtherFlights(Schema):
    """Further flights with the gains of each that would decide the comparison, if the difference stays the same."""

    trial: int
    against: int


class FlightPair(Schema):
    """One flight's gains compared with another's, each with all their flights.

    `difference` is trial − against; `confidence` is that of the likelier direction, or, for `repeats` in one campaign,
    that anything has changed.
    """

    trial_id: int
    against_id: int
    basis: Annotated[
        Basis,
        Field(
            description="kind of comparison: different `gains` on one vehicle; `repeats` of the same gains; flights "
            "that are `apart`, because their vehicles or experiments differ; or none, because one of them has "
            "`no error`"
        ),
    ]
    verdict: Verdict | None
    confidence: float | None
    difference: float | None
    standard_error: float | None
    further: FurtherFlights | None
    sentence: str


class FlightComparison(Schema):
    """A comparison of flights, in the order in which they were named.

    In each pair the later flight is compared with the earlier. `sentence` is the overall verdict: the lowest compared
    with the first one, or with the next lowest.
    """

    error_unit: str
    verdict: Verdict | None
    sentence: str
    notes: list[str]
    flights: list[ComparedFlight]
    gains: list[FlightDifference]
    settings: list[FlightDifference]
    pairs: list[FlightPair]
    file_stem: Annotated[str, Field(description="stem of the names of files exported from this comparison")]
