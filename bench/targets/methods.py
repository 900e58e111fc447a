"""What is compared: each method starts with the default gains, or with the optimum of the nominal model (the paper's
recommended start), and asks for one flight after the other.

Black-box methods search the default bounds as a unit cube, in their libraries' own settings, and stand by the best they
have observed. The Gaussian processes are told the logarithm of the error, which suits them better.
"""

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, Protocol
from unittest.mock import patch

import numpy as np
from scipy.optimize import minimize

from app.autopilots.registry import EXPERIMENTS, evidence_of
from app.core.definition import Definition, Flight, OptionValue, Start, StopRule
from app.core.experiments.base import prior_distribution
from app.core.policy import PolicySpace, Vector
from app.core.tuning.corrected_model import start_gains
from app.core.tuning.definition_checks import problems_of
from app.core.tuning.evidence import Evidence
from app.core.tuning.gate import check_policy
from app.core.tuning.proposals import next_proposal
from app.core.tuning.strategies import STRATEGIES, gradient
from bench.predictions import prediction_of
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
    are tuned by a method that takes long over each proposal, and the twin of the paper's drone with `most_twins` seeds
    (None: all)."""

    title: str
    run: Method
    budget: int
    recommends_last: bool = False
    needs: tuple[str, ...] = ()
    most_vehicles: int | None = None
    most_twins: int | None = 0

    @property
    def missing(self) -> tuple[str, ...]:
        return tuple(name for name in self.needs if find_spec(name) is None)


class Search(Protocol):
    """What a black-box method needs to know: the bounds, the number of flights, and the error of gains flown."""

    @property
    def space(self) -> PolicySpace: ...
    @property
    def budget(self) -> int: ...
    @property
    def campaign_seed(self) -> int: ...
    def error(self, gains: Vector) -> float:
        """Fly the nearest valid gains and return their error. Raises BudgetSpentError."""
        ...


def _from_unit(search: Search, point: Vector) -> Vector:
    space = search.space
    return np.asarray(space.lower + point * (space.upper - space.lower))


def _default_point(search: Search) -> Vector:
    space = search.space
    return np.asarray((space.default - space.lower) / (space.upper - space.lower))


def _optuna(search: Search, sampler: "BaseSampler", *, logarithm: bool) -> None:
    import optuna  # noqa: PLC0415 - of the group `bench`

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=sampler)
    study.enqueue_trial(dict(zip(search.space.names, _default_point(search).tolist(), strict=True)))
    while True:
        trial = study.ask()
        point = [trial.suggest_float(name, 0.0, 1.0) for name in search.space.names]
        error = search.error(_from_unit(search, np.array(point)))
        study.tell(trial, math.log(error) if logarithm else error)


def _tpe(search: Search) -> None:
    from optuna.samplers import TPESampler  # noqa: PLC0415

    _optuna(search, TPESampler(seed=search.campaign_seed), logarithm=False)


def _cma_es(search: Search) -> None:
    """Start in the middle of the bounds, after flying the default gains."""
    from optuna.samplers import CmaEsSampler  # noqa: PLC0415

    _optuna(search, CmaEsSampler(seed=search.campaign_seed), logarithm=False)


def _gp(search: Search) -> None:
    import torch  # noqa: PLC0415
    from optuna.samplers import GPSampler  # noqa: PLC0415

    torch.set_num_threads(1)
    _optuna(search, GPSampler(seed=search.campaign_seed), logarithm=True)


def _bayes_opt(search: Search) -> None:
    """Expected improvement by 1 %; noise of a thousandth of the observed variance, about what the flights have."""
    from bayes_opt import BayesianOptimization  # noqa: PLC0415
    from bayes_opt.acquisition import ExpectedImprovement  # noqa: PLC0415

    optimizer = BayesianOptimization(
        f=None,
        pbounds=dict.fromkeys(search.space.names, (0.0, 1.0)),
        acquisition_function=ExpectedImprovement(xi=0.01),
        random_state=search.campaign_seed,
        verbose=0,
        allow_duplicate_points=True,
    )
    optimizer.set_gp_params(alpha=1e-3)
    random = np.random.default_rng(search.campaign_seed)
    for point in (_default_point(search), *random.random((_STARTUP - 1, len(search.space.names)))):
        optimizer.register(point, -math.log(search.error(_from_unit(search, point))))
    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # scikit-learn warns about length scales at their bounds
            suggested = optimizer.suggest()
        point = np.array([suggested[name] for name in search.space.names], dtype=np.float64)
        optimizer.register(point, -math.log(search.error(_from_unit(search, point))))


_STARTUP: Final = 5
"""Random flights before the Gaussian process is used, including the default gains: the library's default."""


def _nelder_mead(search: Search) -> None:
    """First steps of a tenth of each range, upward; begun again from the best when the simplex has collapsed."""
    start = _default_point(search)

    def error(point: Vector) -> float:
        return search.error(_from_unit(search, point))

    while True:
        simplex = np.vstack((start, start + np.diag(np.where(start > 0.5, -0.1, 0.1))))
        found = minimize(
            error,
            start,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * len(start),
            options={"initial_simplex": simplex, "xatol": 0.002, "fatol": 1e-4, "maxfev": search.budget + 1},
        )
        start = np.asarray(found.x)


def _finite_differences(search: Search) -> None:
    """The gradient by one more flight for each gain, a twentieth of its range further on; then a line search that
    doubles the step while that helps, or halves it until it does."""
    base, lowest, length = _default_point(search), search.error(_from_unit(search, _default_point(search))), 0.2
    while True:
        steps = np.diag(np.where(base > 0.5, -0.05, 0.05))
        slopes = np.array([(search.error(_from_unit(search, base + step)) - lowest) / step.sum() for step in steps])
        direction = -slopes / (float(np.linalg.norm(slopes)) or 1.0)
        improved = False
        for _ in range(5):
            point = np.clip(base + length * direction, 0.0, 1.0)
            error = search.error(_from_unit(search, point))
            if error < lowest:
                base, lowest, improved = point, error, True
                length *= 2.0
            elif improved:
                break
            else:
                length /= 2.0


StartKind = Literal["default", "simplex"]


def _as_published(*, scaled: bool, start: StartKind) -> Method:
    """The paper's method without a gate, and without the fit of the vehicle's parameters that only the gate needs: the
    strategy asks the gate about every step, so that here it is answered for."""

    def run(tuning: Tuning) -> None:
        definition = _definition("gradient", {"scaled": scaled}, tuning, start)
        begun = Evidence(definition=definition, experiment=EXPERIMENT, flights=())
        history = [tuning.fly(SPACE.vector(start_gains(begun)))]
        while True:
            with patch.multiple(
                gradient,
                allows=lambda *_: True,
                known_distribution=lambda known: prior_distribution(known.experiment),
            ):
                proposal = STRATEGIES["gradient"].propose(replace(begun, flights=history))
            if proposal.kind == "none":
                tuning.settle(SPACE.vector(proposal.gains), "nothing better")
                return
            history.append(tuning.fly(SPACE.vector(proposal.gains)))

    return run


def _campaign(strategy: str, options: Mapping[str, OptionValue], start: StartKind) -> Method:
    """A strategy proposal by proposal and through the gate as in a campaign: a refused proposal is not flown and ends
    the tuning."""

    def run(tuning: Tuning) -> None:
        definition = _definition(strategy, options, tuning, start)
        history: list[Flight] = []
        while True:
            evidence = evidence_of(definition, history)
            proposal = next_proposal(evidence)
            if proposal.kind == "none":
                tuning.settle(SPACE.vector(proposal.gains), "nothing better")
                return
            gate = check_policy(evidence, proposal.gains)
            if not gate.passed:
                tuning.ended = "refused: " + ", ".join(check.name for check in gate.checks if not check.passed)
                return
            flown = tuning.fly(SPACE.vector(proposal.gains), proposal.interval)
            history.append(replace(flown, predicted=prediction_of(proposal)))

    return run


def _definition(strategy: str, options: Mapping[str, OptionValue], tuning: Tuning, start: StartKind) -> Definition:
    definition = Definition(
        strategy=strategy,
        options=dict(options),
        start=Start(kind=start),
        stop=StopRule(kind="budget", max_flights=tuning.budget),
        seed=tuning.campaign_seed,
    )
    assert problems_of(definition, EXPERIMENTS) == ()
    return definition


_STARTS: Final[Mapping[StartKind, str]] = MappingProxyType(
    {"default": "the default gains", "simplex": "the simplex start"}
)


def _papers(name: str, line: str, *, scaled: bool) -> dict[str, Compared]:
    """The paper's method from both starts, each as published and through the gate, which takes most of the time."""
    found: dict[str, Compared] = {}
    for start, origin in _STARTS.items():
        key, title = name if start == "default" else f"{name}-{start}", f"The paper's method, {line}, from {origin}"
        published, gated = _as_published(scaled=scaled, start=start), _campaign("gradient", {"scaled": scaled}, start)
        found[key] = Compared(f"{title}, no gate", published, budget=10, most_twins=50)
        found[f"{key}-gate"] = Compared(f"{title}, Gainline's gate", gated, budget=10, most_vehicles=50, most_twins=50)
    return found


SEARCHES: Final[Mapping[str, Callable[[Search], None]]] = MappingProxyType(
    {
        "nelder-mead": _nelder_mead,
        "finite-differences": _finite_differences,
        "tpe": _tpe,
        "cma-es": _cma_es,
        "gp": _gp,
        "bayes-opt": _bayes_opt,
    }
)
"""The black-box methods."""

METHODS: Final[Mapping[str, Compared]] = MappingProxyType(
    {
        "calibrated": Compared(
            "Gainline: calibrated",
            _campaign("calibrated", {}, "default"),
            budget=3,
            recommends_last=True,
            most_twins=None,
        ),
        "calibrated-simplex": Compared(
            "Gainline: calibrated, from the simplex start",
            _campaign("calibrated", {}, "simplex"),
            budget=3,
            recommends_last=True,
            most_twins=50,
        ),
        "simplex": Compared("The simplex start alone", _as_published(scaled=False, start="simplex"), budget=1),
        **_papers("gradient-raw", "raw", scaled=False),
        **_papers("gradient", "gains scaled", scaled=True),
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
