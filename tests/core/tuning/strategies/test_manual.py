import numpy as np
import pytest

from app.core.definition import Definition
from app.core.tuning.corrected_model import correct_by_bias
from app.core.tuning.strategies.manual import corrected_model, propose
from tests.core.tuning.bowl import QuadraticExperiment, fly
from tests.core.tuning.defined import evidence


def test_the_operator_starts_from_the_best_flown_gains() -> None:
    flights = [fly(1, 90, 90), fly(2, 40, 50), fly(3, 50, 50)]
    proposal = propose(evidence(Definition(strategy="manual"), QuadraticExperiment(), flights))
    assert proposal.kind == "manual"
    assert proposal.gains == {"a": 40, "b": 50}
    assert proposal.explanation.base_flight == 2
    assert proposal.predicted_error is not None
    assert abs(proposal.predicted_error - (1.0 + 1.0 + 1.0 + 0.25)) < 1e-6
    assert "proposes no step" in proposal.explanation.summary


def test_the_landscape_that_is_shown_beside_them_is_the_models_corrected_by_the_best_flight() -> None:
    flights = [fly(1, 90, 90), fly(2, 40, 50)]
    errors = corrected_model(evidence(Definition(strategy="manual"), QuadraticExperiment(), flights)).errors(
        np.array([[40.0, 50.0], [30.0, 40.0]])
    )
    corrected = correct_by_bias(QuadraticExperiment(), flights[1])
    assert errors[0] == pytest.approx(flights[1].error, abs=1e-6)
    assert errors[1] == pytest.approx(corrected.predict(np.array([30.0, 40.0])).error, abs=1e-12)
