"""What gains are proposed and judged by: a campaign's definition, its experiment and its flights."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

from app.core.definition import Definition, Flight, best_flight
from app.core.experiments.base import Experiment
from app.core.policy import PolicySpace
from app.core.statistics.comparisons import Group, PooledScatter, groups_of, pool_scatter

_E_co = TypeVar("_E_co", bound=Experiment, covariant=True)


@dataclass(frozen=True, kw_only=True)
class Evidence(Generic[_E_co]):
    """`experiment` is the one that the definition names, as configured there; `flights` are the valid and aborted ones,
    in order."""

    definition: Definition
    experiment: _E_co
    flights: Sequence[Flight]

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

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The valid flights by their gains."""
        return groups_of(self.flights)

    @cached_property
    def scatter(self) -> PooledScatter:
        """The scatter of the groups, with the experiment's prior."""
        return pool_scatter(self.groups, self.experiment.scatter)
