"""The table of who may do what."""

import itertools

import pytest

from app.accounts.permissions import Caller, Key, Permission, is_allowed, require
from app.common.errors import NotAllowedError

ELSEWHERE = "from another device (192.0.2.9)"

# Written apart from the program's table: the least key here, elsewhere, and whether an exposed server does it at all.
NEEDED = {
    Permission.CHANGE: (Key.NONE, Key.REMOTE, True),
    Permission.LINK: (Key.NONE, None, False),
    Permission.REAL: (Key.SCRIPT, None, False),
    Permission.TAKE_OFF: (Key.BROWSER, None, False),
    Permission.STOP: (Key.SCRIPT, None, True),
    Permission.REVIEW: (Key.SCRIPT, None, True),
}


@pytest.mark.parametrize(
    ("act", "because", "key", "exposed"), [*itertools.product(Permission, ["", ELSEWHERE], Key, [False, True])]
)
def test_permissions_follow_the_domain_and_refusals_give_the_reason(
    act: Permission, because: str, key: Key, exposed: bool
) -> None:
    here, elsewhere, where_others_are = NEEDED[act]
    needed = elsewhere if because else here
    expected = needed is not None and key >= needed and (where_others_are or not exposed)
    caller = Caller(key, exposed, because)
    assert is_allowed(act, caller) == expected
    if expected:
        require(act, caller, "Bee")
        return
    with pytest.raises(NotAllowedError) as refused:
        require(act, caller, "Bee")
    assert refused.value.hint


def test_abort_and_land_need_no_key_on_this_computer() -> None:
    assert is_allowed(Permission.CHANGE, Caller())
    assert is_allowed(Permission.CHANGE, Caller(exposed=True))


def test_a_refusal_names_the_vehicle_and_the_way_out() -> None:
    with pytest.raises(NotAllowedError, match="Bee is a real vehicle") as locked:
        require(Permission.REAL, Caller(), "Bee")
    assert "gainline unlock" in locked.value.hint
    assert "Abort and Land still work without it" in locked.value.hint
    assert "Bearer" not in locked.value.hint, "a page shows the hint"
    assert "Bearer" in locked.value.script_hint
    with pytest.raises(NotAllowedError, match=r"from another device \(192.0.2.9\)"):
        require(Permission.REAL, Caller(Key.BROWSER, because=ELSEWHERE), "Bee")
    with pytest.raises(NotAllowedError, match="other devices can reach the server"):
        require(Permission.LINK, Caller(key=Key.BROWSER, exposed=True), "Bee")
