"""Schema of a bundle, with the validation of its contents, and what the contents of earlier versions lack.

A zip of `manifest.json` (the program that wrote it, and the SHA-256 of every other part), `contents.json` (the
campaign, after those that it starts from), and one part for each record, photo and telemetry log. A record is stored as
in the database (`app.db.trajectories`), with its own checksum.
"""

from collections.abc import Mapping, Set
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, AwareDatetime, ConfigDict, Field, TypeAdapter, model_validator
from pydantic_core import PydanticCustomError

from app.campaigns.schemas import Definition
from app.campaigns.trials.schemas import TrialFacts
from app.common.schemas import Gate, Name, OptionValue, Schema
from app.common.states import CampaignState, Ending, Outcome, TrialState
from app.core.definition import Interval
from app.core.experiments.base import ParameterDistribution
from app.core.records.glitches import Glitch
from app.core.tuning.proposals import Advice
from app.core.tuning.stop_rules import StopVerdict
from app.core.tuning.strategy import Explanation
from app.core.tuning.strategy import Kind as ProposalKind
from app.db.base import JsonObject
from app.db.earlier_ends import give_end
from app.vehicles.flight_end import FlightEnd
from app.vehicles.registry import IMPORT

VERSION: Final = 6
MANIFEST: Final = "manifest.json"
CONTENTS: Final = "contents.json"

MAX_CAMPAIGNS: Final = 20
"""Maximum number of campaigns in one bundle."""

_MAX_CHARACTERS: Final = 10_000

Count = Annotated[int, Field(ge=0, le=2**53)]
ShortText = Annotated[str, Field(max_length=200)]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Part = Annotated[str, Field(pattern=r"^(records|photos|telemetry)/[0-9a-z-]{1,60}\.[a-z]{3,5}$")]
Gains = Annotated[dict[ShortText, int | float], Field(min_length=1, max_length=50)]
Options = Annotated[dict[ShortText, OptionValue], Field(max_length=100)]


_adapter: Final = cache(TypeAdapter[Any])


def _fits(kind: Any) -> AfterValidator:
    """Validator that returns the same object if it is valid for this type; stored numbers must not change their
    type."""

    def check(given: JsonObject) -> JsonObject:
        _adapter(kind).validate_python(given)
        return given

    return AfterValidator(check)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spread(ParameterDistribution):
    """A parameter distribution with the numbers of the flights that it was fitted to."""

    flights: list[int] | None = None


def _concise(given: FlightEnd) -> FlightEnd:
    words = given.remarks if given.request is None else (*given.remarks, given.request.words)
    if sum(map(len, words)) > _MAX_CHARACTERS:
        raise ValueError(f"has more than {_MAX_CHARACTERS} characters")
    return given


class _Strict(Schema):
    """A part of the contents: no other fields, no numbers that are not finite, no endless text."""

    model_config = ConfigDict(extra="forbid", from_attributes=True, allow_inf_nan=False, str_max_length=_MAX_CHARACTERS)

    def values_without(self, names: Set[str]) -> dict[str, Any]:
        """The other fields with their values as they came; a dump would change the types of stored numbers."""
        return {name: getattr(self, name) for name in type(self).model_fields.keys() - names}


def _known(version: int) -> int:
    if version > VERSION:
        found = {"version": version, "newest": VERSION}
        raise PydanticCustomError(
            "newer_version", "is {version}, written by a newer Gainline; this version reads up to {newest}", found
        )
    return version


class Manifest(_Strict):
    """Manifest of a bundle. `parts`: the SHA-256 of every other file in the zip, by its name."""

    format: Literal["gainline-campaign"]
    version: Annotated[int, Field(strict=True, ge=1), AfterValidator(_known)]
    program: ShortText
    made_at: AwareDatetime
    parts: Annotated[dict[Annotated[str, Field(max_length=100)], Digest], Field(max_length=20_000)]


class Record(_Strict):
    """A stored trajectory; `part` holds its samples, compressed."""

    part: Part
    codec: Literal[1]
    columns: Annotated[list[ShortText], Field(min_length=2, max_length=64)]
    samples: Annotated[int, Field(ge=1, le=1_000_000)]
    duration_s: float
    source: ShortText
    clock: ShortText
    checksum: Digest
    created_at: AwareDatetime


class Photo(_Strict):
    part: Part
    media_type: ShortText
    added_at: AwareDatetime


class Trial(TrialFacts, _Strict):
    """A trial as in the database. `proposal` is an index into the campaign's proposals, from 0; without one,
    `predicted` is the trial's own predicted curve."""

    number: Annotated[int, Field(ge=1, le=2**31)]
    gains: Gains
    read_back: Gains | None
    proposal: Annotated[int, Field(ge=0)] | None
    predicted_interval: Annotated[JsonObject, _fits(Interval)] | None
    predicted: Record | None
    gate: Annotated[JsonObject, _fits(Gate)]
    record: Record | None
    curve: Annotated[list[tuple[float, float]], Field(max_length=5000)] | None
    ending: Ending | None
    end: Annotated[FlightEnd, AfterValidator(_concise)] | None
    settings: Options
    glitches: list[Annotated[JsonObject, _fits(Glitch)]] | None
    landing_battery_v: float | None
    seed: Count
    photos: Annotated[list[Photo], Field(max_length=100)]
    telemetry: Part | None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.state in {TrialState.STAGED, TrialState.FLYING}:
            raise ValueError(f"is {self.state}: a bundle holds no flight that is under way")
        if self.state == TrialState.VALID and self.error is None:
            raise ValueError("is valid without an error")
        return self


class Proposal(_Strict):
    history_digest: Digest
    kind: ProposalKind
    gains: Gains
    predicted_error: float | None
    predicted: Record | None
    explanation: Annotated[JsonObject, _fits(Explanation)]
    gate: Annotated[JsonObject, _fits(Gate)]
    stop_verdict: Annotated[JsonObject, _fits(StopVerdict)]
    interval: Annotated[JsonObject, _fits(Interval)] | None
    advice: Annotated[JsonObject, _fits(Advice)] | None
    spread: Annotated[JsonObject, _fits(_Spread)] | None
    computed_at: AwareDatetime


class Vehicle(_Strict):
    """The vehicle that the campaign was flown on, as named in the other installation."""

    kind: ShortText
    name: Name
    title: Name
    is_real: bool
    registered: bool
    safe_gains: Gains


class Campaign(_Strict):
    """A campaign. `id` is the one in the other installation; the imported campaign gets a new one."""

    id: Annotated[int, Field(ge=1, le=2**63 - 1)]
    name: Name
    state: CampaignState
    outcome: Outcome | None
    stop_reason: str
    definition: Annotated[JsonObject, _fits(Definition)]
    definition_digest: Digest | None
    safe_gains: Gains | None
    open_until_flight: Annotated[int, Field(ge=0, le=10_000)]
    vehicle: Vehicle
    vehicle_options: Options
    created_at: AwareDatetime
    trials: Annotated[list[Trial], Field(max_length=5000)]
    proposals: Annotated[list[Proposal], Field(max_length=10_000)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        numbers = [trial.number for trial in self.trials]
        if len(set(numbers)) < len(numbers):
            raise ValueError("has two trials with the same number")
        if self.state == CampaignState.FLYING:
            raise ValueError("is flying: a bundle holds no flight that is under way")
        for trial in self.trials:
            if trial.proposal is not None and trial.proposal >= len(self.proposals):
                raise ValueError(
                    f"trial {trial.number} refers to proposal {trial.proposal}, which is not in the bundle"
                )
        return self

    def records(self) -> list[tuple[str, Record]]:
        """Every record with the name of its field."""
        flown = [(f"trials.{i}.record", trial.record) for i, trial in enumerate(self.trials)]
        planned = [(f"trials.{i}.predicted", trial.predicted) for i, trial in enumerate(self.trials)]
        proposed = [(f"proposals.{i}.predicted", proposal.predicted) for i, proposal in enumerate(self.proposals)]
        return [(field, record) for field, record in (*flown, *planned, *proposed) if record is not None]


class Contents(_Strict):
    """The campaign comes last, after those that it starts from, the first of them first."""

    campaigns: Annotated[list[Campaign], Field(min_length=1, max_length=MAX_CAMPAIGNS)]


_IN_CAMPAIGNS: Final[Mapping[int, Mapping[str, object]]] = {3: {"open_until_flight": 0}}
_IN_TRIALS: Final[Mapping[int, Mapping[str, object]]] = {
    2: {"abort_cause": None},
    4: {"rise_time_s": None, "settling_time_s": None, "steady_state_error_m": None},
    5: {"predicted": None},
    6: {"end": None},  # earlier ones have only its words, as the reason
}
"""By the version that brought them, the fields, and what they are in a bundle of before."""


def bring_up_to_date(contents: Any, version: int) -> None:
    """Complete the contents of a bundle of that version, so that the schema knows the present one only. Whatever is
    malformed stays, to be refused afterwards."""
    if version == VERSION:
        return
    of_campaign, of_trial = _lacking(_IN_CAMPAIGNS, version), _lacking(_IN_TRIALS, version)
    with suppress(AttributeError, KeyError, TypeError):
        for campaign in contents["campaigns"]:
            campaign.update(of_campaign | campaign)
            has_flown = campaign["vehicle"]["kind"] != IMPORT.name
            for trial in campaign["trials"]:
                trial.update(of_trial | trial)
                if "end" in of_trial:
                    give_end(trial, was_flown=has_flown and trial["ending"] is not None)


def _lacking(brought: Mapping[int, Mapping[str, object]], version: int) -> dict[str, object]:
    return {name: value for since, fields in brought.items() if since > version for name, value in fields.items()}
