"""Permissions: the one table that routes and services consult. Pure decisions; `app.web.origin` reads the caller from a
request, `app.accounts.keys_and_links` holds the secret behind the keys.

A caller is on this computer or elsewhere, and holds a key or none. A forwarded request counts as from elsewhere: a
proxy or tunnel on this computer connects from loopback on behalf of remote clients.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from typing import Final

from app.common.errors import NotAllowedError


class Key(IntEnum):
    """The key that a caller has presented; each permits more than those before it."""

    NONE = 0
    REMOTE = 1
    """Key of a browser or script on another device."""
    SCRIPT = 2
    """Key of a script on this computer."""
    BROWSER = 3
    """Key of a browser on this computer that a person has unlocked."""


class Permission(Enum):
    """Kinds of operations that depend on the caller."""

    CHANGE = auto()
    """Whatever changes or computes something, including an abort and a land command."""
    LINK = auto()
    """Operations on a vehicle with a link: register, edit, connect, request acts, fly."""
    REAL = auto()
    """The same operations on a real vehicle."""
    TAKE_OFF = auto()
    """The takeoff of a real vehicle."""
    STOP = auto()
    """Stopping a real vehicle's motors, or closing its link; also permitted where no link may be opened."""
    REVIEW = auto()
    """Planning and reviewing flights of a real vehicle, which moves nothing."""


@dataclass(frozen=True, slots=True)
class Rule:
    """The lowest key that an operation needs, by the caller's place; None: never permitted from there.

    `exposed`: whether it is permitted on a server that other devices can reach.
    """

    here: Key
    elsewhere: Key | None
    exposed: bool


PERMISSION_RULES: Final[Mapping[Permission, Rule]] = {
    Permission.CHANGE: Rule(here=Key.NONE, elsewhere=Key.REMOTE, exposed=True),
    Permission.LINK: Rule(here=Key.NONE, elsewhere=None, exposed=False),
    Permission.REAL: Rule(here=Key.SCRIPT, elsewhere=None, exposed=False),
    Permission.TAKE_OFF: Rule(here=Key.BROWSER, elsewhere=None, exposed=False),
    Permission.STOP: Rule(here=Key.SCRIPT, elsewhere=None, exposed=True),
    Permission.REVIEW: Rule(here=Key.SCRIPT, elsewhere=None, exposed=True),
}
"""Reading needs no rule: every client that reaches the server may read."""


@dataclass(frozen=True, slots=True)
class Caller:
    """The sender of a request. `exposed`: the server listens beyond loopback. `because`: why the caller counts as
    elsewhere, empty for one on this computer."""

    key: Key = Key.NONE
    exposed: bool = False
    because: str = ""

    @property
    def is_elsewhere(self) -> bool:
        return bool(self.because)


COMMAND_LINE: Final = Caller(key=Key.BROWSER)
"""A command that runs on the data folder itself."""

UNLOCK_HINT: Final = (
    "Open the link that the terminal printed at startup, or run `gainline unlock` on the computer that runs "
    "Gainline and open the link that it prints."
)
_FOR_SCRIPTS: Final = "Send the token that `gainline unlock --script` prints as `Authorization: Bearer TOKEN`."

STAGED_BY_SCRIPT: Final = (
    "A script can propose gains and stage the flight; the operator then holds the button on the fly screen."
)


def is_allowed(act: Permission, caller: Caller) -> bool:
    rule = PERMISSION_RULES[act]
    if caller.exposed and not rule.exposed:
        return False
    needed = rule.elsewhere if caller.is_elsewhere else rule.here
    return needed is not None and caller.key >= needed


def require(act: Permission, caller: Caller, vehicle: str = "") -> None:
    """Raise NotAllowedError, which says what is missing, unless permitted. `vehicle` is the name of the vehicle
    concerned."""
    if is_allowed(act, caller):
        return
    rule, because = PERMISSION_RULES[act], "connected over a link" if act is Permission.LINK else "a real vehicle"
    if caller.exposed and not rule.exposed:
        raise NotAllowedError(
            f"{vehicle} cannot be commanded from this server: it is {because}, and other devices can reach the server.",
            hint="Start the server with --host 127.0.0.1 on the computer that has the link to the vehicle.",
        )
    if caller.is_elsewhere and rule.elsewhere is None:
        raise NotAllowedError(
            f"{vehicle} is {because}: it accepts commands from this computer only, and the request came "
            f"{caller.because}.",
            hint="Use a browser on the computer that runs Gainline, at the address that the terminal printed, "
            "without a proxy or tunnel.",
        )
    if caller.is_elsewhere:
        raise NotAllowedError(
            f"This browser has read-only access, because the request came {caller.because}.",
            hint=UNLOCK_HINT,
            script_hint=_FOR_SCRIPTS,
        )
    if act is Permission.TAKE_OFF:
        raise NotAllowedError(
            f"{vehicle} is a real vehicle: only its operator can start the takeoff, in an unlocked browser.",
            hint=UNLOCK_HINT,
            script_hint=STAGED_BY_SCRIPT,
        )
    raise NotAllowedError(
        f"{vehicle} is a real vehicle, and this browser is not unlocked for it.",
        hint=f"{UNLOCK_HINT} Abort and Land still work without it.",
        script_hint=f"{_FOR_SCRIPTS} Abort and land need no key.",
    )


@dataclass(frozen=True, slots=True)
class RequestContext:
    """Origin of a request: the lease token that it carries, its caller, whether Gainline's own page sent it, and the
    hosts that the administrator has listed as simulating vehicles."""

    token: str | None = None
    caller: Caller = COMMAND_LINE
    from_our_page: bool = False
    simulation_hosts: frozenset[str] = frozenset()


LOCAL_CLI: Final = RequestContext()
"""A user of this computer's command line, who is in control of no vehicle."""
