"""Verdicts on pairs of flights with known errors, computed here once more with scipy's t distribution."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pytest
from scipy import stats

from app.core.experiments.base import Scatter
from app.core.policy import Gains
from app.core.statistics.comparisons import (
    SCATTER_NOT_KNOWN,
    FlightsToDecide,
    Group,
    PooledScatter,
    Verdict,
    pool_scatter,
)
from app.core.statistics.pairs import (
    LeadingPair,
    Population,
    Side,
    compare_pair,
    find_leading_pair,
    list_notes,
    overall_verdict,
)

PRIOR: Final = Scatter(sd=0.0105, degrees_of_freedom=4.0)
UNKNOWN: Final = PooledScatter(sigma=0.0105, degrees_of_freedom=4.0, known=False)
FIRST: Final = {"kp": 283.0, "ki": 13.0}
OTHER: Final = {"kp": 300.0, "ki": 60.0}
THIRD: Final = {"kp": 290.0, "ki": 40.0}
HERE: Final = Population(1, "Twin", "Takeoff", settings="{}", known=True)
TO_COMPARE: Final = "The errors depend on this as well as on the gains. To compare gains, fly both in one campaign."


def group(gains: Gains, *errors: float, first: int = 1) -> Group:
    return Group(gains, tuple(range(first, first + len(errors))), errors)


def fly(
    *groups: Group,
    campaign_id: int = 1,
    of: str = "",
    population: Population = HERE,
    scatter: PooledScatter | None = None,
) -> list[Side]:
    """The flights of one campaign by their numbers, with its own scatter unless one is given."""
    pooled = pool_scatter(groups, PRIOR) if scatter is None else scatter
    sides = [
        Side(
            number=number,
            name=f"flight {number}{of}",
            state="valid",
            campaign_id=campaign_id,
            error_unit="m",
            group=own,
            scatter=pooled,
            population=population,
        )
        for own in groups
        for number in own.numbers
    ]
    return sorted(sides, key=lambda side: side.number)


def aborted(number: int) -> Side:
    (side,) = fly(group(OTHER, 0.5, first=number))
    return replace(side, group=None, state="aborted")


def pooled(*groups: Sequence[float]) -> tuple[float, float]:
    """The scatter of one flight and its degrees of freedom, from the prior and the repeats of these errors."""
    freedom = PRIOR.degrees_of_freedom + sum(len(one) - 1 for one in groups)
    squares = PRIOR.degrees_of_freedom * PRIOR.sd**2 + sum(float(np.var(one)) * len(one) for one in groups)
    return (squares / freedom) ** 0.5, freedom


def t_test(own: Sequence[float], other: Sequence[float], *more: Sequence[float]) -> tuple[float, float, float]:
    """Difference, its standard error and the confidence in its direction, by the pooled t test with the prior."""
    sigma, freedom = pooled(own, other, *more)
    difference = float(np.mean(own) - np.mean(other))
    standard_error = sigma * (1 / len(own) + 1 / len(other)) ** 0.5
    return difference, standard_error, float(stats.t(freedom).cdf(abs(difference) / standard_error))


def test_a_flight_stands_for_all_of_its_gains_with_the_confidence_of_a_t_test() -> None:
    slow, quick = (0.60, 0.62), (0.58, 0.57, 0.59)
    first, _, third, _, fifth = fly(group(FIRST, *slow), group(OTHER, *quick, first=3))
    better, worse = compare_pair(fifth, first), compare_pair(first, third)
    assert (better.difference, better.standard_error, better.confidence) == pytest.approx(t_test(quick, slow))
    assert (worse.difference, worse.standard_error, worse.confidence) == pytest.approx(t_test(slow, quick))
    assert (better.basis, better.verdict, better.further) == ("gains", "better", None)
    assert (worse.basis, worse.verdict, worse.further) == ("gains", "worse", None)
    assert better.sentence == (
        "Flight 5 (kp 300, ki 60; 3 flights) is better than flight 1 (kp 283, ki 13; 2 flights): "
        "0.030 ± 0.010 m lower, 99.0\u00a0% confidence."
    )
    assert worse.sentence == (
        "Flight 1 (kp 283, ki 13; 2 flights) is worse than flight 3 (kp 300, ki 60; 3 flights): "
        "0.030 ± 0.010 m higher, 99.0\u00a0% confidence."
    )


def test_what_is_unresolved_says_which_further_flights_would_decide() -> None:
    first, second = fly(group(FIRST, 0.610), group(OTHER, 0.600, first=2))
    found = compare_pair(second, first)
    assert (found.basis, found.verdict, found.further) == ("gains", "unresolved", FlightsToDecide(first=4, second=3))
    difference, standard_error, confidence = t_test([0.600], [0.610])
    assert (found.difference, found.standard_error, found.confidence) == pytest.approx(
        (difference, standard_error, confidence)
    )
    decided, short_of = (
        stats.t(PRIOR.degrees_of_freedom + own + other - 2).cdf(
            abs(difference) / PRIOR.sd / (1 / own + 1 / other) ** 0.5
        )
        for own, other in ((5, 4), (4, 4))
    )
    assert short_of < 0.9 <= decided
    assert found.sentence == (
        "Unresolved: flight 2 (kp 300, ki 60; 1 flight) against flight 1 (kp 283, ki 13; 1 flight), "
        "0.010 ± 0.015 m lower, 73\u00a0% confidence. If the difference persists, 7 more flights would resolve it: "
        "4 with the gains of flight 2 and 3 with the gains of flight 1."
    )


def test_what_a_hundred_flights_would_not_decide_is_not_promised() -> None:
    first, second = fly(group(FIRST, 0.6), group(OTHER, 0.6, first=2))
    found = compare_pair(second, first)
    assert (found.verdict, found.further) == ("unresolved", None)
    assert found.sentence.endswith("0\u00a0% confidence. Even 100 more flights would not resolve it.")


def test_gains_are_not_told_apart_while_the_scatter_is_unknown() -> None:
    first, second = fly(group(FIRST, 0.6), group(OTHER, 0.5, first=2), scatter=UNKNOWN)
    found = compare_pair(second, first)
    assert (found.basis, found.verdict, found.confidence, found.standard_error, found.further) == (
        "gains", "not known yet", None, None, None
    )  # fmt: skip
    assert found.difference == pytest.approx(-0.1)
    assert found.sentence == (
        "Not known yet: flight 2 (kp 300, ki 60; 1 flight) against flight 1 (kp 283, ki 13; 1 flight), "
        f"0.100 m lower. {SCATTER_NOT_KNOWN}"
    )


def test_a_flight_without_an_error_that_counts_is_named() -> None:
    (flown,) = fly(group(FIRST, 0.6))
    for side, against in ((aborted(2), flown), (flown, aborted(2)), (aborted(2), aborted(3))):
        found = compare_pair(side, against)
        assert found.sentence == "Flight 2 is aborted: it has no error that counts."
        assert (found.basis, found.verdict, found.difference, found.confidence) == ("no error", None, None, None)


ELSEWHERE: Final = Population(2, "Flown elsewhere", "Takeoff", settings="campaign 1", known=False)


@pytest.mark.parametrize(
    ("population", "first", "how", "why"),
    [
        (
            Population(2, "JSBSim", "Altitude steps", settings="{}", known=True),
            HERE,
            "in another experiment",
            "Different experiments (Takeoff, Altitude steps)",
        ),
        (
            Population(2, "JSBSim", "Takeoff", settings="{}", known=True),
            HERE,
            "flown by another vehicle",
            "Different vehicles (Twin, JSBSim)",
        ),
        (
            replace(ELSEWHERE, settings="campaign 2"),
            ELSEWHERE,
            "perhaps flown by another vehicle",
            "Flights flown elsewhere: it is unknown whether the same vehicle flew both campaigns",
        ),
        (
            replace(HERE, settings='{"wind": 3}'),
            HERE,
            "flown with different settings of the vehicle",
            "One vehicle with different settings",
        ),
    ],
)
def test_between_populations_there_is_a_difference_and_no_verdict(
    population: Population, first: Population, how: str, why: str
) -> None:
    """Two means with a scatter each: the variances of the means add."""
    one = fly(group(FIRST, 0.6, 0.6), population=first, of=" of One")
    two = fly(
        group(OTHER, 0.5, 0.51, first=3),
        campaign_id=2,
        population=population,
        of=" of Two",
        scatter=PooledScatter(sigma=0.02, degrees_of_freedom=9.0),
    )
    found = compare_pair(two[0], one[0])
    assert (found.basis, found.verdict, found.confidence, found.further) == ("apart", None, None, None)
    assert found.difference == pytest.approx(0.505 - 0.6)
    assert found.standard_error == pytest.approx((PRIOR.sd**2 * 4 / 5 / 2 + 0.02**2 / 2) ** 0.5)
    told = f"No verdict on the gains: flight 3 of Two, {how}, is 0.095 ± 0.016 m lower than flight 1 of One."
    assert found.sentence == told
    assert list_notes([one[0], *two]) == [f"{why}. {TO_COMPARE}"], "once for all flights of a campaign"
    assert overall_verdict(find_leading_pair([one[0], two[0]])) == (None, told)


@pytest.mark.parametrize("scatters", [(UNKNOWN, None), (None, UNKNOWN)])
def test_a_difference_between_populations_has_no_uncertainty_while_a_scatter_is_unknown(
    scatters: tuple[PooledScatter | None, PooledScatter | None],
) -> None:
    (one,) = fly(group(FIRST, 0.5), of=" of One", scatter=scatters[0])
    (two,) = fly(group(OTHER, 0.6), of=" of Two", scatter=scatters[1], population=replace(HERE, experiment="Steps"))
    found = compare_pair(two, one)
    assert found.difference == pytest.approx(0.1)
    assert found.standard_error is None
    assert found.sentence.endswith("in another experiment, is 0.100 m higher than flight 1 of One.")


@pytest.mark.parametrize(
    ("error", "relation"),
    [
        (0.610, "0.010 ± 0.015 m apart, no more than the scatter of flights (46\u00a0% confidence"),
        (0.550, "0.050 ± 0.015 m apart, more than the scatter of flights (97\u00a0% confidence"),
    ],
)
def test_repeats_are_told_apart_only_when_something_has_changed(error: float, relation: str) -> None:
    """Two-sided, as a change either way would be one."""
    scatter = PooledScatter(sigma=0.0105, degrees_of_freedom=4.0)
    first, _, third = fly(group(FIRST, 0.600, 0.605, error), scatter=scatter)
    difference, standard_error = error - 0.600, 2**0.5 * 0.0105
    confidence = 1.0 - 2.0 * stats.t(4.0).sf(abs(difference) / standard_error)
    for side, against, sign in ((third, first, 1), (first, third, -1)):
        found = compare_pair(side, against)
        assert (found.basis, found.verdict, found.further) == ("repeats", None, None)
        assert (found.difference, found.standard_error, found.confidence) == pytest.approx(
            (sign * difference, standard_error, confidence)
        )
        assert found.sentence == (
            f"The same gains (kp 283, ki 13): {side.name} and {against.name} are {relation} "
            "that something has changed)."
        )


def test_repeats_are_told_apart_alike_whichever_is_named_first() -> None:
    """Observed defect: with the earlier flight against the later one, 0.005 ± −0.013 m apart, 0 % confidence."""
    earlier, later = fly(group(FIRST, 0.600, 0.605))
    forward, back = compare_pair(later, earlier), compare_pair(earlier, later)
    assert forward.difference == pytest.approx(0.005)
    swapped = forward.sentence.replace("flight 2 and flight 1", "flight 1 and flight 2")
    assert back == replace(forward, difference=-(forward.difference or 0.0), sentence=swapped)
    assert "are 0.005 ± 0.013 m apart" in back.sentence


CHANGED: Final = "more than the scatter: the vehicle or its environment has changed (99\u00a0% confidence)"


@pytest.mark.parametrize(
    ("error", "verdict", "apart", "relation"),
    [
        (0.600, "unresolved", "0.000 ± 0.015 m higher", "within the scatter (50\u00a0% confidence)"),
        (0.610, "unresolved", "0.010 ± 0.015 m higher", "within the scatter (73\u00a0% confidence)"),
        (0.650, "worse", "0.050 ± 0.015 m higher", CHANGED),
        (0.550, "better", "0.050 ± 0.015 m lower", CHANGED),
    ],
)
def test_the_same_gains_in_two_campaigns_are_repeats(error: float, verdict: Verdict, apart: str, relation: str) -> None:
    """Even if they flew the same to the last digit, as a simulation does: flight 1 of one is not that of the other."""
    (morning,) = fly(group(FIRST, 0.600), of=" of Morning")
    (evening,) = fly(group(dict(reversed(FIRST.items())), error), campaign_id=2, of=" of Evening")
    found = compare_pair(evening, morning)
    assert (found.basis, found.verdict) == ("repeats", verdict)
    assert (found.difference, found.standard_error, found.confidence) == pytest.approx(t_test([error], [0.600]))
    assert found.sentence == (
        f"The same gains in two campaigns: flight 1 of Evening is {apart} than flight 1 of Morning, {relation}."
    )


def test_the_same_gains_in_two_campaigns_are_not_told_apart_while_the_scatter_is_unknown() -> None:
    (morning,) = fly(group(FIRST, 0.6), of=" of Morning", scatter=UNKNOWN)
    (evening,) = fly(group(FIRST, 0.5), campaign_id=2, of=" of Evening", scatter=UNKNOWN)
    found = compare_pair(evening, morning)
    assert (found.basis, found.verdict, found.confidence, found.standard_error) == (
        "repeats", "not known yet", None, None
    )  # fmt: skip
    assert found.sentence == (
        "Not known yet: with the same gains in two campaigns flight 1 of Evening is 0.100 m lower than flight 1 of "
        f"Morning. {SCATTER_NOT_KNOWN}"
    )


def test_the_first_flight_is_compared_with_the_lowest_mean_plus_its_standard_error() -> None:
    """A single flight does not overtake what has repeated nearly the same error."""
    sides = fly(group(FIRST, 0.60), group(OTHER, 0.501, 0.501, first=2), group(THIRD, 0.500, first=4))
    leading = find_leading_pair(sides)
    assert leading == LeadingPair(best=sides[1], other=sides[0], policies=3)


def test_the_other_of_the_leading_pair_has_other_gains_and_an_error() -> None:
    best, again, second, lowest = fly(
        group(FIRST, 0.50, 0.50), group(OTHER, 0.60, first=3), group(THIRD, 0.55, first=4)
    )
    assert find_leading_pair([best, second, lowest]) == LeadingPair(best, lowest, policies=3)
    assert find_leading_pair([aborted(5), second, lowest, best]) == LeadingPair(best, lowest, policies=3)
    assert find_leading_pair([aborted(5), best]) is None
    leading = find_leading_pair([best, again])
    assert leading == LeadingPair(best, again, policies=1)
    assert overall_verdict(leading) == (None, compare_pair(best, again).sentence)


def test_fewer_than_two_errors_have_no_verdict() -> None:
    assert overall_verdict(None) == (
        None,
        "No verdict: fewer than two of these flights have an error that counts.",
    )


def test_of_two_gain_sets_none_was_chosen() -> None:
    first, second = fly(group(FIRST, 0.60), group(OTHER, 0.57, first=2))
    leading = find_leading_pair([first, second])
    alone = compare_pair(second, first)
    assert compare_pair(second, first, leading) == alone
    assert overall_verdict(leading) == (alone.verdict, alone.sentence)
    assert alone.sentence.startswith("Flight 2 (kp 300, ki 60; 1 flight) is better than flight 1")


def test_the_best_of_several_gets_no_credit_for_having_been_chosen() -> None:
    """Between three gain sets a mistake counts twice (Bonferroni), in the sentence and in the table alike."""
    sides = fly(group(FIRST, 0.60, 0.60), group(OTHER, 0.58, first=3), group(THIRD, 0.59, first=4))
    first, again, best, between = sides
    leading = find_leading_pair(sides)
    alone, pair = compare_pair(best, first), compare_pair(best, first, leading)
    assert (alone.verdict, pair.verdict) == ("better", "unresolved")
    _, _, once = t_test([0.58], [0.60, 0.60], [0.59])
    assert alone.confidence == pytest.approx(once)
    assert pair.confidence == pytest.approx(1.0 - 2.0 * (1.0 - once))
    assert overall_verdict(leading) == (
        "unresolved",
        f"Flight 3 is the lowest of 3 gain sets, and the confidence allows for this choice. {pair.sentence}",
    )
    assert f", {100 * (1.0 - 2.0 * (1.0 - once)):.0f}\u00a0% confidence." in pair.sentence
    assert compare_pair(first, best, leading).confidence == pair.confidence, "whichever is named first"
    assert compare_pair(best, again, leading).confidence == pair.confidence, "each flight of these gains"
    for side in (first, best):
        assert compare_pair(between, side, leading) == compare_pair(between, side), "another pair was not chosen"


def test_a_scatter_shared_by_campaigns_is_told_once_for_each_population() -> None:
    shared, lone = PooledScatter(sigma=0.0123, degrees_of_freedom=9.0), replace(HERE, settings="other")
    one = fly(group(FIRST, 0.6, 0.6), scatter=shared)
    two = fly(group(OTHER, 0.5), campaign_id=2, scatter=shared)
    (apart,) = fly(group(OTHER, 0.5), campaign_id=3, population=lone)
    sentence = "Scatter of one flight: 0.0123 m, pooled over repeats in 2 campaigns of the same vehicle and experiment."
    assert list_notes([*one, *two]) == [sentence]
    notes = list_notes([*one, apart, *two])
    assert len(notes) == 2
    assert notes[0].startswith("One vehicle with different settings. ")
    assert notes[1] == sentence
    assert list_notes(one) == [], "of one campaign only"
    assert list_notes([replace(side, scatter=UNKNOWN) for side in (*one, *two)]) == [], "not known yet"
