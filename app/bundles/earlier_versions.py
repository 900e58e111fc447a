"""The versions of bundles: what each brought, and with what a bundle of before is completed.

An earlier bundle becomes one of the present version before it is checked, so that the schema knows this one only.
"""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from app.db.earlier_ends import give_end
from app.vehicles.registry import IMPORT

VERSION: Final = 6
_IN_CAMPAIGNS: Final[Mapping[int, Mapping[str, object]]] = {3: {"open_until_flight": 0}}
_IN_TRIALS: Final[Mapping[int, Mapping[str, object]]] = {
    2: {"abort_cause": None},
    4: {"rise_time_s": None, "settling_time_s": None, "steady_state_error_m": None},
    5: {"predicted": None},
    6: {"end": None},  # earlier ones have only its words, as the reason
}
"""By the version that brought them, the fields, and what they are in a bundle of before."""


def bring_up_to_date(contents: Any, version: int) -> None:
    """Complete the contents of a bundle of that version. Whatever is malformed stays, to be refused afterwards."""
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
