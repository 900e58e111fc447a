"""The table of hazards against the reducer of a trial alone: what each does to the messages that arrive, in each state
of a trial, has the ending that its row names, and no consequence but those that `bench.hostile` permits, which flies
the same hazards over a link.

Left out are hazards that the link or the connection finds before the reducer (a second vehicle with the same ids,
copies of packets, other components and ports, gains that were not verified), and all but one of the fields whose values
are no numbers, which a profile reads alike.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise, product

import pytest

from app.vehicles.flight_end import Landing
from app.vehicles.mavlink.records import ending_of
from app.vehicles.mavlink.trial_state import TRANSITIONS
from bench.hazards.hostile_checks import GroundTruth, ReportedOutcome, judge
from bench.hazards.hostile_table import HAZARDS
from bench.hazards.rig import InjectedFault
from bench.hazards.trial_states import LIFTED_M, State, TrialStates
from tests.bench.reducer_effects import EFFECTS
from tests.bench.reducer_flight import Flight
from tests.bench.test_hostile import case
from tests.vehicles.mavlink.walking import PLAN, STEP_S, once

LONGEST_S = 130.0
BEGIN = {State.ARM: 0.1, State.TAKEOFF: 0.3, State.RECORD: 1.0, State.LAND: 0.5}
"""States in which a hazard sets in, and how long after they begin."""
LONG_RECORDED = {"no SYS_STATUS": 20.0}
"""Records long enough for a hazard that is noticed late, s."""

Endings = tuple[str, str, str, str]
UNHARMED: Endings = ("", "", "", "")
ENDINGS: Mapping[str, Endings] = {
    "z nan": ("(F9d)", "F9d!", "F9d!", "!"),
    "altitude +0.2 m": ("", "!", "!", "!"),
    "replaced after 1.3 s": ("(F5)", "F5!", "F5!", "!"),
    "on the ground after 0 s": ("(F9a)", "F9a!", "F9d!", "!"),
    "on the ground after 0.3 s": ("(F9a)", "F9a", "F9d!", "!"),
    "on the ground after 0.6 s": ("(F9d)", "F9d", "F9d!", "!"),
    "on the ground after 1 s": ("(F9d)", "F9d!", "F9d!", "!"),
    "ground every second": ("F9b", "F9b", "F9b", ""),
    "later and later, to 1 s": ("F9d", "F9d", "F9d", ""),
    "later and later, to 2 s": ("(F9d)", "F9d", "F9d", ""),
    **{f"all stamps {by_s:+g} s": ("", "", "F9a", "") for by_s in (-0.5, -0.3, 0.3, 0.5)},
    "all stamps +1 s": ("(F9a)", "F9a", "F9a", ""),
    "all stamps -1 s": ("(F9a)", "F9a!", "F9a!", "!"),
    **{f"all stamps {by_s:+g} s": ("", "", "F9a!", "") for by_s in (-3.0, -2.0, 2.0, 3.0)},
    "commands 2 s late": ("F4a!", "", "", ""),
    "no HEARTBEAT": ("F5!", "F5!", "F5!", "!"),
    "no LOCAL_POSITION_NED": ("(F9a)", "F9a!", "F9a!", "!"),
    "no SYS_STATUS": ("F7", "F7", "F7", ""),
    "no EXTENDED_SYS_STATE": ("!", "!", "!", "!"),
    "mocap nan": ("(F9a)", "F9a", "F9a", ""),
    "mocap silent": ("(F9a)", "F9a", "F9a", ""),
    "mocap frozen": ("(F9a)", "F9a", "F9a", ""),
    "mocap 1 m higher": ("F9c!", "F9c!", "F9c!", "!"),
    "pilot": ("F4a!", "F10a!", "F10a!", "F10a!"),
    "pilot for 1 s": ("", "", "F10c", ""),
    "pilot for 3 s": ("F4a", "F10a!", "F10a!", "F10a!"),
    "deaf": ("F4a!", "!", "!", "!"),
    "carried away": ("F6", "F6", "F6", "F6"),
    "reboot": ("(F5)", "F5!", "F5!", "F10b!"),
    "foreign kill": ("(F3)", "F13!", "F13!", "F10b!"),
    "flies home": ("", "F10b!", "F10b!", "F10b!"),
    "drifts by 0.5 m/s": ("(F9d)", "F9d!", "F9d!", "F9d!"),
    "drifts by 0.1 m/s": ("F9d!", "F9d!", "F9d!", "F9d!"),
    "drifts by 0.5 m/s unwitnessed": ("(F9d)", "F9d!", "F9d!", "F9d!"),
    "stuck altitude": ("(F9a)", "F9a!", "F9a!", "F9d!"),
    "stuck altitude unwitnessed": ("(F9a)", "F9a!", "F9a!", "!"),
    "lean oscillation": ("F6", "F6", "F6", "F6"),
}
"""The failure by its number in docs/real-flight.md, in the order of `BEGIN`: in brackets if nothing was flown, with "!"
if the vehicle is quarantined; empty if the flight is complete. A hazard without a row changes no flight."""


@once
def reached(state: State, *, has_second_source: bool = False, record_s: float = PLAN.record_s) -> Flight:
    """A flight in this state."""
    flight = Flight(plan=replace(PLAN, record_s=record_s), has_second_source=has_second_source)
    while flight.state.value != state:
        flight.pass_s(STEP_S)
    return flight.pass_s(BEGIN[state])


def flown(name: str, state: State) -> tuple[Flight, GroundTruth]:
    record_s = LONG_RECORDED.get(name, PLAN.record_s)
    flight = reached(state, has_second_source=name.startswith("mocap"), record_s=record_s)
    begun_s, flight.hazard = flight.now_s, EFFECTS[name](flight)
    flight.hazard.begin()
    while not flight.trial.is_over and flight.now_s < begun_s + LONGEST_S:
        flight.pass_s(STEP_S)
    lasts_s = HAZARDS[name].longest_s
    truth = GroundTruth(
        case=case("paparazzi", name, state, BEGIN[state], lasts_s),
        states=TrialStates(ended_s=flight.now_s),
        injected=[InjectedFault(name, state, begun_s, begun_s + lasts_s)],
        sent=(),
        stops=(),
        true_states=(),
        armed=flight.armed,
        holds_safe=True,
        rose_m=flight.climbed_m,
    )
    return flight, truth


LEFT_OUT = ("flies home", State.ARM)
"""Whether it rises before it was commanded to, only its body knows."""
RARE = {
    f"{which} {sign * by_s:+g} s"
    for which, by_s, sign in product(("one stamp", "all stamps"), (0.3, 0.5, 2.0, 3.0), (1, -1))
}
"""Further values of a hazard: on record alone, and not in the everyday ring."""


def is_asked(name: str, state: State) -> bool:
    is_further = name in RARE and state is not State.RECORD
    return state in HAZARDS[name].states and (name, state) != LEFT_OUT and not is_further


CELLS = [
    pytest.param(name, state, ending, marks=() if state is State.RECORD and name not in RARE else pytest.mark.complete)
    for name in EFFECTS
    for state, ending in zip(BEGIN, ENDINGS.get(name, UNHARMED), strict=True)
    if is_asked(name, state)
]


@pytest.mark.parametrize(("name", "state", "ending"), CELLS)
def test_a_hazard_has_the_ending_of_its_row_and_no_consequence_that_is_not_permitted(
    name: str, state: State, ending: str
) -> None:
    flight, truth = flown(name, state)
    trial = flight.trial
    assert trial.is_over
    reported = ReportedOutcome(
        outcome=ending_of(trial) if trial.contact is not Landing.STAYED else "refused",
        vehicle="quarantined" if trial.state.value == "quarantined" else "safe",
        reason=trial.why,
        concern=trial.why,
        failure=trial.failure or "",
    )
    assert list(judge(truth, reported)) == []
    found = f"({reported.failure})" if reported.outcome == "refused" else reported.failure
    assert found + ("!" if reported.vehicle == "quarantined" else "") == ending
    assert all(height_m < LIFTED_M for height_m in flight.stops_m), "motors off above the ground"
    assert all(later in TRANSITIONS[earlier] for earlier, later in pairwise(flight.states))


def test_every_row_names_a_hazard() -> None:
    assert set(ENDINGS) <= set(EFFECTS) <= set(HAZARDS)


def test_without_a_hazard_the_vehicle_flies_lands_and_has_its_safe_gains_back() -> None:
    flight = reached(State.LAND)
    while not flight.trial.is_over:
        flight.pass_s(STEP_S)
    assert (flight.state, flight.trial.failure) == ("idle", None)
