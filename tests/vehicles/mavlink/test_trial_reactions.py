from app.vehicles.mavlink.trial_state import COMMANDED, OVER, TRANSITIONS, State


def reachable(start: State) -> set[State]:
    found, waiting = {start}, [start]
    while waiting:
        for following in TRANSITIONS[waiting.pop()] - found:
            found.add(following)
            waiting.append(following)
    return found


def test_every_state_has_its_moves_and_can_be_reached() -> None:
    assert set(TRANSITIONS) == set(State)
    assert reachable(State.IDLE) == set(State)


def test_from_every_state_a_trial_can_come_to_rest() -> None:
    for state in State:
        assert State.IDLE in reachable(state)


def test_what_was_armed_comes_to_rest_only_with_its_gains_restored_or_in_quarantine() -> None:
    before = {state for state, following in TRANSITIONS.items() if State.IDLE in following}
    assert before == {State.CONNECT, State.PREFLIGHT, State.SET_GAINS, State.RESTORE, State.QUARANTINE, State.OBSERVE}


def test_nothing_goes_back_into_the_air() -> None:
    assert not TRANSITIONS[State.QUARANTINE] - {State.IDLE}
    for landing in (State.LAND, State.ABORT_LAND, State.DISARM, State.RESTORE, State.LINK_LOST):
        assert not TRANSITIONS[landing] & {State.ARM, State.TAKEOFF, State.RECORD}


def test_quarantine_can_be_reached_from_every_state_that_moves_the_vehicle() -> None:
    for state in COMMANDED | {State.LINK_LOST, State.DISARM, State.RESTORE}:
        assert State.QUARANTINE in TRANSITIONS[state]
    assert frozenset({State.IDLE, State.QUARANTINE}) == OVER
