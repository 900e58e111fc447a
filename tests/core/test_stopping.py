import pytest

from app.core.definition import StopRule
from app.core.stopping import verdict

PAPER = StopRule()


@pytest.mark.parametrize(
    ("errors", "stop", "reason"),
    [
        ([], False, None),
        ([0.3775], False, None),
        ([0.3775, 0.2006, 0.1596, 0.1733], False, None),  # Table 1, left: run 5 was flown …
        ([0.3775, 0.2006, 0.1596, 0.1733, 0.1521], True, "not improving"),  # … and improved by 4.7 % only
        ([0.5102, 0.2537, 0.2265, 0.2652, 0.2483], True, "not improving"),  # Table 2, left
        ([0.1006, 0.0966], False, None),
        ([0.1006, 0.0966, 0.0940], True, "not improving"),  # Table 1, right, taken literally; the paper flew one more
        ([0.1218, 0.1249, 0.1278], True, "not improving"),  # Table 2, right
        ([0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01], True, "flight budget"),
    ],
)
def test_the_papers_rule_on_the_papers_series(errors: list[float], stop: bool, reason: str | None) -> None:
    judged = verdict(PAPER, errors)
    assert (judged.stop, judged.reason) == (stop, reason)


def test_an_improvement_of_exactly_the_fraction_is_not_more_than_it() -> None:
    rule = StopRule(improvement=0.5)
    assert verdict(rule, [0.5, 0.25]).failures == 1
    assert verdict(rule, [0.5, 0.2499]).failures == 0


def test_small_gains_that_add_up_do_not_count() -> None:
    """Each flight is held against the best so far, not against the last that counted."""
    assert verdict(PAPER, [1.0, 0.96, 0.93]).stop


def test_one_success_between_failures_resets_the_count() -> None:
    judged = verdict(PAPER, [1.0, 1.1, 0.9, 1.2])
    assert (judged.stop, judged.failures) == (False, 1)
    assert judged.threshold == pytest.approx(0.855)
    assert "one more such flight" in judged.why


def test_an_aborted_flight_neither_improves_nor_fails_but_uses_up_budget() -> None:
    assert verdict(PAPER, [0.5, None, None]).reason is None
    assert verdict(PAPER, [0.5, 0.49, None, 0.48]).reason == "not improving"
    assert verdict(PAPER, [None, 0.5]).failures == 0
    assert verdict(PAPER, [None]).threshold is None
    assert verdict(PAPER, [None] * 7).reason == "flight budget"


def test_a_line_without_anything_better_ends_the_paper_rule_only() -> None:
    assert verdict(PAPER, [0.5], "none").reason == "nothing better on the line"
    assert verdict(PAPER, [0.5], "manual").reason is None
    assert verdict(StopRule(kind="budget"), [0.5], "none").reason is None


def test_the_budget_rule_counts_flights_only() -> None:
    rule = StopRule(kind="budget", max_flights=4)
    assert not verdict(rule, [0.5, 0.5, 0.5]).stop
    assert verdict(rule, [0.5, 0.5, 0.5]).why == "1 of 4 flights are left."
    assert verdict(rule, [0.5] * 4).reason == "flight budget"
    assert "All 4 flights" in verdict(rule, [0.5] * 4).why
