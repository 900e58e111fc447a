"""Unlocking of a browser: a link that works once and sets a cookie."""

from typing import Annotated, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.responses import Response

from app.accounts.keys_and_links import LINK_VALID_S, Keyring
from app.accounts.permissions import UNLOCK_HINT, Caller, Key, Permission, RequestOrigin, is_allowed
from app.common.schemas import Schema
from app.web.origin import caller_of

unlock_router = APIRouter(tags=["system"])

KEPT_S: Final = 90 * 24 * 3600
_HEADERS: Final = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer"}
"""The token is in the address: these headers keep it out of caches and from the next page."""

_UNLOCKED: Final = "/?unlocked"
"""The first page, which confirms it."""

_SPENT: Final = f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Gainline: this link has been used</title>
<style>
:root {{ color-scheme: light dark; font: 18px/1.5 system-ui, sans-serif }}
main {{ max-width: 34rem; margin: 15vh auto; padding: 0 1.5rem }}
</style>
<main>
<h1>This link has been used or has expired</h1>
<p>A link unlocks one browser, within {LINK_VALID_S // 60} minutes. Run <code>gainline unlock</code> on the computer
that runs Gainline, and open the link that it prints.</p>
<p><a href="/">Open the dashboard</a>; it cannot command real vehicles from this browser.</p>
</main>
</html>
"""


class Access(Schema):
    """What the client may do: `may_change` campaigns and simulated flights, `may_link` vehicles with a link,
    `may_command` real ones. `elsewhere`: the client is not on this computer. `hint` describes how to unlock a browser;
    empty if a link would change nothing."""

    elsewhere: bool
    may_change: bool
    may_link: bool
    may_command: bool
    hint: str


@unlock_router.get("/api/access")
def get_access(request: Request) -> Access:
    """What this client may do."""
    caller = caller_of(request)
    may_change, may_command = is_allowed(Permission.CHANGE, caller), is_allowed(Permission.TAKE_OFF, caller)
    return Access(
        elsewhere=caller.place is RequestOrigin.ELSEWHERE,
        may_change=may_change,
        may_link=is_allowed(Permission.LINK, caller),
        may_command=may_command,
        hint="" if may_command or not _would_help(caller) else UNLOCK_HINT,
    )


def _would_help(caller: Caller) -> bool:
    if caller.place is RequestOrigin.ELSEWHERE:
        return caller.key < Key.REMOTE
    return not caller.exposed


@unlock_router.get("/unlock", include_in_schema=False)
def unlock(request: Request, token: Annotated[str, Query(max_length=200)] = "") -> Response:
    """Exchange a link's token for a cookie, once. What the cookie permits depends on where the browser is."""
    keyring: Keyring = request.app.state.keyring
    caller = caller_of(request)
    given = keyring.given_to(caller.place)
    if not keyring.open_link(token):
        if caller.key >= given:  # the link was opened twice in the same browser
            return RedirectResponse(_UNLOCKED, 303, headers=_HEADERS)
        return HTMLResponse(_SPENT, 403, headers=_HEADERS)
    answer = RedirectResponse(_UNLOCKED, 303, headers=_HEADERS)
    answer.set_cookie(keyring.cookie, keyring.value(given), max_age=KEPT_S, httponly=True, samesite="strict")
    return answer
