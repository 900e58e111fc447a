"""What a person must accept before a record from elsewhere is stored: why it does not count as it is, and how else it
may be read."""

from collections.abc import Collection, Sequence
from typing import Annotated, Final, Self

from pydantic import Field

from app.autopilots.takeoffs import NOT_COMMANDED
from app.common.errors import Problem, UnconfirmedError
from app.common.schemas import Request
from app.core.records.plausibility import ExpectedFlight, Reading, find_implausible
from app.core.records.trajectory import Trajectory


class Accepted(Request):
    """What a person chooses and accepts of a log or record, as the query of its upload."""

    takeoff: Annotated[
        int | None, Field(ge=1, le=10_000, description="number of the takeoff in a log with several")
    ] = None
    confirm: Annotated[
        bool, Field(description="accept a log that was flown with other gains; the trial takes the gains in the log")
    ] = False
    invalid: Annotated[
        bool, Field(description="accept a record that cannot be scored or is implausible, as an invalid flight")
    ] = False
    reads_as: Annotated[
        frozenset[Reading], Field(description="read the record in these units, with this sign, above this datum")
    ] = frozenset()

    def answering(self, problems: Collection[Problem]) -> Self:
        """This and what an UnconfirmedError with these problems asks for; if that is a reading, nothing else."""
        readings = frozenset(Reading(problem.code) for problem in problems if problem.field == "reads_as")
        asked = {"reads_as": self.reads_as | readings} if readings else {each.field: True for each in problems}
        return self.model_copy(update=asked)


UNSCORABLE: Final = "unscorable"
NOT_COMMANDED_CODE: Final = "not commanded"


def find_doubts(
    expected: ExpectedFlight | None, record: Trajectory, unscorable: str, *, is_commanded: bool
) -> tuple[Problem, ...]:
    """Why a record does not count as it is; nothing if it does. `unscorable` is why it has no error, if it has none,
    `expected` what a flight flown elsewhere must show."""
    if not is_commanded:
        return (Problem("invalid", NOT_COMMANDED, code=NOT_COMMANDED_CODE),)
    if unscorable:
        return (Problem("invalid", unscorable, code=UNSCORABLE),)
    findings = () if expected is None else find_implausible(expected, record)
    return tuple(Problem("invalid", found.sentence, code=found.code) for found in findings)


def reason_of(doubts: Sequence[Problem]) -> str:
    """The reasons for a person."""
    return "; ".join(doubt.reason for doubt in doubts)


def unconfirmed(doubts: Sequence[Problem], readings: Sequence[Reading]) -> UnconfirmedError:
    """The question whether a record is stored as an invalid flight; or read so, where that explains it."""
    begins = {UNSCORABLE: "The record cannot be scored:", NOT_COMMANDED_CODE: "The record is"}
    begin = begins.get(doubts[0].code, "The record shows no flight of this campaign:")
    looks = " and ".join(reading.words for reading in readings)
    offers = (Problem("reads_as", f"looks like {reading.words}", code=reading) for reading in readings)
    return UnconfirmedError(
        f"{begin} {reason_of(doubts)}.{looks and f' It looks like one with {looks}.'}",
        hint=f"Choose the complete log of this flight{looks and ', confirm that this one is read so'}, or confirm that "
        "it is stored as an invalid flight.",
        problems=(*offers, *doubts),
    )
