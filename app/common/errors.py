"""The application's errors, derived from the core's root. Only `app.web.errors` maps them to HTTP.

GainlineError                 (app.core.errors)
├── InputError                unusable input
│   ├── GainsError            a gain vector that may not be flown
│   ├── TrajectoryError       a recorded flight that cannot be scored
│   ├── UnconfirmedError      a person has to confirm the request first
│   ├── KeyReusedError        an idempotency key that was used for another request
│   ├── TooLargeError         more bytes than the program accepts
│   └── MediaTypeError        a type of content that is not accepted
├── NotAllowedError           not permitted from there, or not for this caller
│   └── ForeignRequestError   from a page of another site, or under a foreign host name
├── NotFoundError             there is no such object
├── ConflictError             not possible now: the state or the version forbids it
│   └── BusyError             the vehicle has a flight or an act under way
├── UnavailableError          this installation lacks what is needed, or it is in use; all else works
├── StorageError              the database cannot read or write; nothing was changed
│   └── SchemaError           the database belongs to another version of the program
├── AlreadyRunningError       another process of the program holds the database
└── AddressError              the server cannot listen on the requested host and port
"""

from app.core.errors import GainlineError, GainsError, InputError, Problem, TrajectoryError

__all__ = ["GainlineError", "GainsError", "InputError", "Problem", "TrajectoryError"]


class UnconfirmedError(InputError):
    """The input differs from what was planned, and no person has confirmed it."""


class KeyReusedError(InputError):
    """An idempotency key was sent again with a different request."""


class TooLargeError(InputError):
    """More bytes than the program accepts in one request."""


class MediaTypeError(InputError):
    """The content has a type that is not accepted here."""


class NotAllowedError(GainlineError):
    """The request is possible, but not from where it was sent, or not for its caller."""


class ForeignRequestError(NotAllowedError):
    """The request came from a page of another site, or under a host name that is not this server's."""


class NotFoundError(GainlineError):
    """There is no such object."""

    def __init__(self, what: str, identity: object, *, hint: str = "") -> None:
        super().__init__(
            f"There is no {what} {identity}.",
            hint=hint or "It may have been deleted, or the number is wrong. Check the list.",
        )


class ConflictError(GainlineError):
    """The request is not possible in the present state, or is based on an outdated version."""


class BusyError(ConflictError):
    """The vehicle has a flight or an act under way."""


class UnavailableError(GainlineError):
    """This installation lacks what the request needs, or it is in use at present; everything else works."""


class StorageError(GainlineError):
    """The database operation failed; the transaction was rolled back."""


class SchemaError(StorageError):
    """The database is not at this program's revision."""


class AlreadyRunningError(GainlineError):
    """Another server or worker uses this database; there may be one of each."""


class AddressError(GainlineError):
    """The server cannot listen on the requested host and port; `problems` names the one at fault."""
