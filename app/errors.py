"""The application's errors, grown from the core's root. What one means over HTTP is said in `app.api.errors` alone.

GainlineError                 (app.core.errors)
├── InputError                something that came in is not usable
│   ├── GainsError            a gain vector that may not be flown
│   ├── TrajectoryError       a recorded flight that cannot be scored
│   ├── UnconfirmedError      what is asked needs a person's word first
│   ├── KeyReusedError        an idempotency key that already stands for another request
│   ├── TooLargeError         more bytes than the program takes
│   └── MediaTypeError        a kind of content that is not read here
├── NotAllowedError           not from there, or not by them: a real vehicle's safety forbids it
├── NotFoundError             there is no such thing
├── ConflictError             it is not possible now: the state or the version forbids it
│   └── BusyError             the vehicle is flying for somebody else
├── UnavailableError          this installation lacks what is needed, or it is in use; all else works
├── StorageError              the database cannot take or give what it should; nothing was changed
├── SchemaError               the database belongs to another version of the program
├── AlreadyRunningError       another process of the program holds the database
└── AddressError              the host and port asked for cannot be listened on
"""

from app.core.errors import GainlineError, GainsError, InputError, Problem, TrajectoryError

__all__ = [
    "AddressError",
    "AlreadyRunningError",
    "BusyError",
    "ConflictError",
    "GainlineError",
    "GainsError",
    "InputError",
    "KeyReusedError",
    "MediaTypeError",
    "NotAllowedError",
    "NotFoundError",
    "Problem",
    "SchemaError",
    "StorageError",
    "TooLargeError",
    "TrajectoryError",
    "UnavailableError",
    "UnconfirmedError",
]


class UnconfirmedError(InputError):
    """What came in differs from what was planned, and nobody has said that it shall be taken all the same."""


class KeyReusedError(InputError):
    """An idempotency key came again with a different request."""


class TooLargeError(InputError):
    """More bytes than the program takes in one request."""


class MediaTypeError(InputError):
    """The content is of a kind that is not read here."""


class NotAllowedError(GainlineError):
    """What was asked is possible, but not from where it was asked, or not by whom."""


class NotFoundError(GainlineError):
    """There is no such thing."""

    def __init__(self, what: str, identity: object, *, hint: str = "") -> None:
        super().__init__(
            f"There is no {what} {identity}.",
            hint=hint or "It may have been deleted, or the number is mistyped; look it up in its list.",
        )


class ConflictError(GainlineError):
    """What was asked is not possible in the present state, or was decided on an outdated version."""


class BusyError(ConflictError):
    """The vehicle has a flight already."""


class UnavailableError(GainlineError):
    """This installation lacks what is needed for it, or that is in use at present; everything else works."""


class StorageError(GainlineError):
    """The database could not do its work; whatever was under way was undone as a whole."""


class SchemaError(StorageError):
    """The database is not at this program's revision."""


class AlreadyRunningError(GainlineError):
    """Another server or worker has this database; there may be one of each."""


class AddressError(GainlineError):
    """The host and port asked for cannot be listened on; `problems` names the one to blame."""
