"""What all computations of a campaign start from: its definition, its experiment and its flights, with the statistics
that follow from these."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, Self, TypeGuard, TypeVar

from app.core.definition import Definition, Flight, best_flight
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.policy import PolicySpace
from app.core.statistics.comparisons import (
    Comparison,
    Group,
    PooledScatter,
    compare,
    groups_of,
    pool_scatter,
    select_winner,
)

_E_co = TypeVar("_E_co", bound=Experiment, covariant=True)


@dataclass(frozen=True, kw_only=True)
class Evidence(Generic[_E_co]):
    """A campaign's definition, free of problems (`app.core.tuning.definition_checks`), and its flights; what follows
    from them is computed at most once.

    `experiment` is the one that the definition names, as configured there; `flights` are the valid and aborted ones,
    in order, with trajectories as stored. `donor` is the flight named by `definition.start.donor`: required with start
    kind `campaign`, and not allowed with others. Up to `open_until_flight` flights no rule ends the campaign, because
    it was reopened for them. `plain` is the evidence that this one differs from by a better model and a shorter step.
    """

    definition: Definition
    experiment: _E_co
    flights: Sequence[Flight]
    donor: Flight | None = None
    open_until_flight: int = 0
    plain: "Evidence[Experiment] | None" = None

    @cached_property
    def space(self) -> PolicySpace:
        """The gains within the campaign's bounds."""
        return self.experiment.space.narrowed(self.definition.bounds)

    @cached_property
    def valid(self) -> Sequence[Flight]:
        """The flights that count, in order."""
        return [flight for flight in self.flights if flight.outcome == "valid"]

    @property
    def best(self) -> Flight:
        """The valid flight with the lowest error, the earliest of equals; at least one flight must be valid."""
        return best_flight(self.flights)

    @property
    def left(self) -> int:
        """Flights of the budget that are left, with those for which the campaign was reopened."""
        return max(self.definition.stop.max_flights, self.open_until_flight) - len(self.flights)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The valid flights by their gains."""
        return groups_of(self.flights) if self.plain is None else self.plain.groups

    @cached_property
    def scatter(self) -> PooledScatter:
        """The scatter of the groups, with the experiment's prior."""
        return pool_scatter(self.groups, self.experiment.scatter) if self.plain is None else self.plain.scatter

    @cached_property
    def within_bounds(self) -> Self:
        """The evidence of the gains inside the bounds, which may be flown again."""
        gains = self.space.gains
        inside = [
            flight
            for flight in self.flights
            if all(gain.refusal_by_bounds(flight.gains[gain.name]) is None for gain in gains)
        ]
        if len(inside) == len(self.flights):
            return self
        return replace(self, flights=inside, plain=None if self.plain is None else self.plain.within_bounds)

    @property
    def baseline(self) -> Group:
        """The gains of the first valid flight; there must be one, as for `winner`."""
        return self.groups[0]

    @cached_property
    def winner(self) -> Group:
        """The best gains."""
        return select_winner(self.groups, self.scatter)

    @property
    def looks(self) -> int:
        """The number of comparisons of winner and baseline since both were repeated; 0 before."""
        sizes = self.winner.size, self.baseline.size
        return 0 if min(sizes) < 2 else sum(sizes) - 3

    @cached_property
    def comparison(self) -> Comparison | None:
        """The winner compared with the baseline; None while they are the same, and before the first valid flight.

        Under the stop rule `noise` the confidence allows for repeated comparisons; under the other rules, which do not
        decide by it, only for the choice among the policies.
        """
        if not self.groups or self.winner is self.baseline:
            return None
        stop = self.definition.stop
        return compare(
            self.winner,
            self.baseline,
            self.scatter,
            stop.confidence,
            candidates=len(self.groups) - 1,
            looks=self.looks if stop.kind == "noise" else 0,
        )


def has_model(evidence: Evidence[Experiment]) -> TypeGuard[Evidence[ModelledExperiment]]:
    """Whether the experiment has a model, so that flights can be predicted."""
    return isinstance(evidence.experiment, ModelledExperiment)
