"""Ends of flights in the words of earlier versions, for the migration to revision 0010 and bundles before version 6.

Nothing else reads words. What is not recognised stays as it was.
"""

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

with (Path(__file__).parent / "earlier_failures.csv").open(encoding="utf-8", newline="") as _rows:
    _FAILURES: Final = {row["begin"]: row["failure"] for row in csv.DictReader(_rows)}
"""How a reason begins, and the number of its failure, the first if several have the sentence: in the words of 0.3.0,
then of 0.2.0."""
ORIGINS: Final[Mapping[str, str]] = {
    "unstaged by the operator": "operator",
    "unstaged from another browser": "another browser",
    "unstaged from another device": "another device",
    "unstaged by a script": "script",
}
_TAKEN_OVER: Final = "F10a"
_ON_GROUND: Final = re.compile(r"(aborted|ended) before lift-off:? ?")
_PROGRAM: Final = re.compile(r"(?:Gainline was stopped|the worker was stopped \(SIG[A-Z0-9]+\))\.? ?")
_RESTORED: Final = re.compile(
    r"(?:It landed the vehicle and restored the safe gains\.|It restored the safe gains before the takeoff\. "
    r"Request the flight again if it is still needed\.) ?"
)
_MOTORS_OFF: Final = re.compile(
    r"Motors off was (?:(?:requested by|asked for: asked for by) the operator|(?:requested|asked for): (?P<words>.+?))"
    r"\.(?: |$)"
)
_BY_OPERATOR: Final = re.compile(r"(?:aborted )?by the operator(?:\. | |$)")
_REQUESTED: Final = frozenset({"operator", "behaved badly", "something else"})
"""Causes of an abort that a person requested."""


def read_end(text: str, *, on_request: bool = False, landed: str = "landed", gains_left: str = "unknown") -> Any:
    """Return the end of a flight as it is stored now. `on_request`: it is known that a person ended it."""
    failure, request, rest = None, None, text
    if (found := _ON_GROUND.match(rest)) is not None:
        landed, on_request, rest = "stayed", on_request or found[1] == "aborted", rest[found.end() :]
    if rest in ORIGINS:
        landed, request, rest = "stayed", _request(by=ORIGINS[rest]), ""
    elif (found := _PROGRAM.match(rest)) is not None:
        failure, request, rest = "F8", _request(by="program stopped"), rest[found.end() :]
        if (known := _RESTORED.match(rest)) is not None:
            gains_left, rest = "safe", rest[known.end() :]
    elif (found := _MOTORS_OFF.match(rest)) is not None:
        failure, request, rest = "F8", _request(found["words"] or "", motors_off=True), rest[found.end() :]
    elif (found := _BY_OPERATOR.match(rest)) is not None:
        failure, request, rest = "F8", _request(), rest[found.end() :]
    elif (begin := next((begin for begin in _FAILURES if rest.startswith(begin)), None)) is not None:
        failure, rest = _FAILURES[begin], rest.removeprefix(begin).lstrip()
    elif on_request:
        failure, request, rest = "F8", _request(rest), ""
    return {
        "failure": failure,
        "request": request,
        "remarks": [rest] if rest else [],
        "gains_left": "flight" if failure == _TAKEN_OVER and gains_left == "unknown" else gains_left,
        "landed": landed,
    }


def _request(words: str = "", *, by: str = "operator", motors_off: bool = False) -> dict[str, object]:
    return {"words": words, "motors_off": motors_off, "by": by}


def landing_of(settings: Mapping[str, Any]) -> str:
    """Earlier versions noted among the settings that a landing was not observed."""
    return "landed" if settings.get("landed", True) else "unknown"


def give_end(trial: dict[str, Any], *, was_flown: bool = False) -> None:
    """Give a trial of an earlier version, without the flight that was its last, the end that its reason tells. A reason
    that is not recognised stays, because a person may have given it; what `was_flown` has an end all the same."""
    landed = landing_of(trial["settings"])
    on_request = trial["state"] == "aborted" and trial.get("abort_cause") in _REQUESTED
    end = read_end("" if trial["state"] == "valid" else trial["reason"], on_request=on_request, landed=landed)
    if end["failure"] is not None or end["request"] is not None:
        trial["end"], trial["reason"] = end, ""
    elif was_flown or landed != "landed":
        trial["end"] = end | {"remarks": []}
