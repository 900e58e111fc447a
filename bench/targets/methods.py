"""What is compared: each method starts with the default gains and asks for one flight after the other.

Black-box methods search the default bounds as a unit cube, in their libraries' own settings, and stand by the best they
have observed. The Gaussian processes are told the logarithm of the error, which suits them better.
"""

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import minimize

from app.core.definition import Definition, Flight, OptionValue, StopRule
from app.core.policy import Vector
from app.core.tuning.definition_checks import check_definition
from app.core.tuning.gate import check_policy
from app.core.tuning.predictions import prediction_of
from app.core.tuning.proposals import next_proposal
from app.core.tuning.strategies import STRATEGIES
from bench.targets.flying import EXPERIMENT, SPACE, Method, Tuning

if TYPE_CHECKING:
    from optuna.samplers import BaseSampler


DISTRIBUTIONS: Final[Mapping[str, str]] = MappingProxyType(
    {"optuna": "optuna", "cmaes": "cmaes", "torch": "torch", "bayes_opt": "bayesian-optimization"}
)
"""Modules of the group `bench`, with the names of their distributions."""


@dataclass(frozen=True, slots=True)
class Compared:
    """One method with its budget of flights; `needs` are modules of the group `bench`; `most_vehicles` of a population
    are tuned by a method that takes long over each proposal."""

    title: str
    run: Method
    budget: int
    recommends_last: bool = False
    needs: tuple[str, ...] = ()
    most_vehicles: int | None = None

    @property
    def missing(self) -> tuple[str, ...]:
        return tuple(name for name in self.needs if find_spec(name) is None)


def _from_unit(point: Vector) -> Vector:
    return np.asarray(SPACE.lower + point * (SPACE.upper - SPACE.lower))


_DEFAULT_POINT: Final = (SPACE.default - SPACE.lower) / (SPACE.upper - SPACE.lower)


def _optuna(tuning: Tuning, sampler: "BaseSampler", *, logarithm: bool) -> None:
    import optuna  # noqa: PLC0415 - of the group `bench`

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=sampler)
    study.enqueue_trial(dict(zip(SPACE.names, _DEFAULT_POINT.tolist(), strict=True)))
    while True:
        trial = study.ask()
        error = tuning.error(_from_unit(np.array([trial.suggest_float(name, 0.0, 1.0) for name in SPACE.names])))
        study.tell(trial, math.log(error) if logarithm else error)


def _tpe(tuning: Tuning) -> None:
    from optuna.samplers import TPESampler  # noqa: PLC0415

    _optuna(tuning, TPESampler(seed=tuning.campaign_seed), logarithm=False)


def _cma_es(tuning: Tuning) -> None:
    """Start in the middle of the bounds, after flying the default gains."""
    from optuna.samplers import CmaEsSampler  # noqa: PLC0415

    _optuna(tuning, CmaEsSampler(seed=tuning.campaign_seed), logarithm=False)


def _gp(tuning: Tuning) -> None:
    import torch  # noqa: PLC0415
    from optuna.samplers import GPSampler  # noqa: PLC0415

    torch.set_num_threads(1)
    _optuna(tuning, GPSampler(seed=tuning.campaign_seed), logarithm=True)


def _bayes_opt(tuning: Tuning) -> None:
    """Expected improvement by 1 %; noise of a thousandth of the observed variance, about what the flights have."""
    from bayes_opt import BayesianOptimization  # noqa: PLC0415
    from bayes_opt.acquisition import ExpectedImprovement  # noqa: PLC0415

    optimizer = BayesianOptimization(
        f=None,
        pbounds=dict.fromkeys(SPACE.names, (0.0, 1.0)),
        acquisition_function=ExpectedImprovement(xi=0.01),
        random_state=tuning.campaign_seed,
        verbose=0,
        allow_duplicate_points=True,
    )
    optimizer.set_gp_params(alpha=1e-3)
    random = np.random.default_rng(tuning.campaign_seed)
    for point in (_DEFAULT_POINT, *random.random((_STARTUP - 1, len(SPACE.names)))):
        optimizer.register(point, -math.log(tuning.error(_from_unit(point))))
    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # scikit-learn warns about length scales at their bounds
            suggested = optimizer.suggest()
        point = np.array([suggested[name] for name in SPACE.names], dtype=np.float64)
        optimizer.register(point, -math.log(tuning.error(_from_unit(point))))


_STARTUP: Final = 5
"""Random flights before the Gaussian process is used, including the default gains: the library's default."""


def _nelder_mead(tuning: Tuning) -> None:
    """First steps of a tenth of each range, upward; begun again from the best when the simplex has collapsed."""
    start = _DEFAULT_POINT

    def error(point: Vector) -> float:
        return tuning.error(_from_unit(point))

    while True:
        simplex = np.vstack((start, start + np.diag(np.where(start > 0.5, -0.1, 0.1))))
        found = minimize(
            error,
            start,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * len(start),
            options={"initial_simplex": simplex, "xatol": 0.002, "fatol": 1e-4, "maxfev": tuning.budget + 1},
        )
        start = np.asarray(found.x)


def _finite_differences(tuning: Tuning) -> None:
    """The gradient by one more flight for each gain, a twentieth of its range further on; then a line search that
    doubles the step while that helps, or halves it until it does."""
    base, lowest, length = _DEFAULT_POINT, tuning.error(_from_unit(_DEFAULT_POINT)), 0.2
    while True:
        steps = np.diag(np.where(base > 0.5, -0.05, 0.05))
        slopes = np.array([(tuning.error(_from_unit(base + step)) - lowest) / step.sum() for step in steps])
        direction = -slopes / (float(np.linalg.norm(slopes)) or 1.0)
        improved = False
        for _ in range(5):
            point = np.clip(base + length * direction, 0.0, 1.0)
            error = tuning.error(_from_unit(point))
            if error < lowest:
                base, lowest, improved = point, error, True
                length *= 2.0
            elif improved:
                break
            else:
                length /= 2.0


def _papers(*, scaled: bool) -> Method:
    """The paper's method as published: no gate."""

    def run(tuning: Tuning) -> None:
        definition = _definition("gradient", {"scaled": scaled}, tuning)
        history = [tuning.fly(SPACE.default)]
        while True:
            proposal = STRATEGIES["gradient"].propose(definition, EXPERIMENT, SPACE, history)
            if proposal.kind == "none":
                tuning.settle(SPACE.vector(proposal.gains), "nothing better")
                return
            history.append(tuning.fly(SPACE.vector(proposal.gains)))

    return run


def _calibrated(tuning: Tuning) -> None:
    """Gainline's own, proposal by proposal and through the gate as in a campaign: a refused proposal is not flown and
    ends the tuning."""
    definition = _definition("calibrated", {}, tuning)
    history: list[Flight] = []
    while True:
        proposal = next_proposal(definition, history)
        if proposal.kind == "none":
            tuning.settle(SPACE.vector(proposal.gains), "nothing better")
            return
        gate = check_policy(definition, EXPERIMENT, SPACE, proposal.gains, history)
        if not gate.passed:
            tuning.ended = "refused: " + ", ".join(check.name for check in gate.checks if not check.passed)
            return
        flown = tuning.fly(SPACE.vector(proposal.gains), proposal.interval)
        history.append(replace(flown, predicted=prediction_of(proposal)))


def _definition(strategy: str, options: Mapping[str, OptionValue], tuning: Tuning) -> Definition:
    definition = Definition(
        strategy=strategy,
        options=dict(options),
        stop=StopRule(kind="budget", max_flights=tuning.budget),
        seed=tuning.campaign_seed,
    )
    check_definition(definition)
    return definition


METHODS: Final[Mapping[str, Compared]] = MappingProxyType(
    {
        "calibrated": Compared("Gainline: calibrated", _calibrated, budget=3, recommends_last=True),
        "gradient": Compared(
            "The paper's method, gains scaled",
            _papers(scaled=True),
            budget=10,
            most_vehicles=50,
        ),
        "gradient-raw": Compared("The paper's method, raw", _papers(scaled=False), budget=10, most_vehicles=50),
        "nelder-mead": Compared("Nelder–Mead on the vehicle", _nelder_mead, budget=60),
        "finite-differences": Compared("Finite differences on the vehicle", _finite_differences, budget=60),
        "tpe": Compared("Optuna, TPE", _tpe, budget=60, needs=("optuna",)),
        "cma-es": Compared("Optuna, CMA-ES", _cma_es, budget=60, needs=("optuna", "cmaes")),
        "gp": Compared("Optuna, Gaussian process", _gp, budget=40, needs=("optuna", "torch"), most_vehicles=25),
        "bayes-opt": Compared(
            "bayesian-optimization, EI", _bayes_opt, budget=40, needs=("bayes_opt",), most_vehicles=25
        ),
    }
)
