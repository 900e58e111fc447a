from app.core.definition import Definition
from app.core.strategies.manual import propose
from tests.core.bowl import Bowl, fly


def test_the_operator_starts_from_the_best_flown_gains() -> None:
    proposal = propose(
        Definition(strategy="manual"), Bowl(), Bowl.space, [fly(1, 90, 90), fly(2, 40, 50), fly(3, 50, 50)]
    )
    assert proposal.kind == "manual"
    assert proposal.gains == {"a": 40, "b": 50}
    assert proposal.explanation.base_flight == 2
    assert proposal.predicted_error is not None
    assert abs(proposal.predicted_error - (1.0 + 1.0 + 1.0 + 0.25)) < 1e-6
    assert "You choose" in proposal.explanation.summary
