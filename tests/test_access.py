"""The table of who may do what."""

import itertools

import pytest

from app.access import Act, Caller, Key, Place, is_allowed, require
from app.errors import NotAllowedError

ELSEWHERE = "from another device (192.0.2.9)"

# Written apart from the program's table: the least key here, elsewhere, and whether an exposed server does it at all.
NEEDED = {
    Act.CHANGE: (Key.NONE, Key.REMOTE, True),
    Act.LINK: (Key.NONE, None, False),
    Act.REAL: (Key.SCRIPT, None, False),
    Act.TAKE_OFF: (Key.BROWSER, None, False),
    Act.STOP: (Key.SCRIPT, None, True),
    Act.REVIEW: (Key.SCRIPT, None, True),
}


@pytest.mark.parametrize(("act", "place", "key", "exposed"), [*itertools.product(Act, Place, Key, [False, True])])
def test_everybody_may_do_what_the_domain_allows_and_is_told_why_not(
    act: Act, place: Place, key: Key, exposed: bool
) -> None:
    here, elsewhere, where_others_are = NEEDED[act]
    needed = here if place is Place.HERE else elsewhere
    expected = needed is not None and key >= needed and (where_others_are or not exposed)
    caller = Caller(place, key, exposed, "" if place is Place.HERE else ELSEWHERE)
    assert is_allowed(act, caller) == expected
    if expected:
        require(act, caller, "Bee")
        return
    with pytest.raises(NotAllowedError) as refused:
        require(act, caller, "Bee")
    assert refused.value.hint


def test_abort_and_land_are_changes_which_nobody_on_this_computer_needs_a_key_for() -> None:
    assert is_allowed(Act.CHANGE, Caller())
    assert is_allowed(Act.CHANGE, Caller(exposed=True))


def test_a_refusal_names_the_vehicle_and_the_way_out() -> None:
    with pytest.raises(NotAllowedError, match="Bee is a real vehicle") as locked:
        require(Act.REAL, Caller(), "Bee")
    assert "gainline unlock" in locked.value.hint
    assert "Abort and land need neither" in locked.value.hint
    with pytest.raises(NotAllowedError, match=r"from another device \(192.0.2.9\)"):
        require(Act.REAL, Caller(Place.ELSEWHERE, Key.BROWSER, because=ELSEWHERE), "Bee")
    with pytest.raises(NotAllowedError, match="can be reached over the network"):
        require(Act.LINK, Caller(key=Key.BROWSER, exposed=True), "Bee")
