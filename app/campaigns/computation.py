"""Computation of a proposal: pure and without the database, for compute processes."""

from dataclasses import dataclass, replace

from app.autopilots.registry import experiment_of
from app.core.definition import Definition, Flight
from app.core.experiments.base import ParameterDistribution
from app.core.experiments.takeoff import Takeoff
from app.core.tuning.campaign_models import known_distribution
from app.core.tuning.gate import GateResult, check_policy
from app.core.tuning.proposals import Advice, advise, next_proposal
from app.core.tuning.stop_rules import StopVerdict, evaluate_stop_rule
from app.core.tuning.strategy import Proposal


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignHistory:
    """All that a proposal is computed from. `digest` changes as soon as any of it does.

    `donor` is the flight that a warm start uses; the definition holds the checksum of its record. `battery_v`
    is the battery voltage, V, at the end of the last flight, including one that does not count. `open_until_flight` is
    the number of flights for which the campaign was reopened, 0 if it was not.
    """

    definition: Definition
    flights: tuple[Flight, ...]
    digest: str
    donor: Flight | None = None
    battery_v: float | None = None
    open_until_flight: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposalComputation:
    """A proposal with its gate result, the parameter distribution `spread` it was checked over, the stop rule's
    verdict, and the recommended next action."""

    history_digest: str
    proposal: Proposal
    gate: GateResult
    spread: ParameterDistribution
    flights: tuple[int, ...]
    stop_verdict: StopVerdict
    advice: Advice


def compute(past: CampaignHistory) -> ProposalComputation:
    """Compute the next proposal. Deterministic: the same history gives the same result.

    Takes up to a second, or some seconds under ArduCopter and PX4; call it outside of any transaction.
    """
    stop, flights = past.definition.stop, past.flights
    budget = max(stop.max_flights, past.open_until_flight)  # with the flights for which the campaign was reopened
    definition = replace(past.definition, stop=replace(stop, max_flights=budget))
    experiment = experiment_of(definition)
    proposal = next_proposal(definition, experiment, flights, past.donor)
    stop_verdict = evaluate_stop_rule(
        past.definition, flights, proposal, battery_v=past.battery_v, open_until_flight=past.open_until_flight
    )
    spread = known_distribution(experiment, flights) if proposal.spread is None else proposal.spread
    gate = check_policy(
        definition,
        experiment,
        experiment.space.narrowed(definition.bounds),
        proposal.gains,
        flights,
        start=proposal.gains if proposal.kind == "start" else None,
        spread=spread,
    )
    return ProposalComputation(
        history_digest=past.digest,
        proposal=proposal,
        gate=gate,
        spread=spread,
        flights=tuple(flight.number for flight in flights if flight.outcome == "valid"),
        stop_verdict=stop_verdict,
        advice=advise(
            definition,
            experiment,
            flights,
            proposal,
            stop_verdict,
            is_reopened=len(flights) < past.open_until_flight,
        ),
    )


def warm_up() -> None:
    """Import and compile what a proposal needs, so that the first one is as fast as the others."""
    definition, experiment = Definition(), Takeoff()
    default = experiment.space.default
    flown = experiment.simulate(default, experiment.nominal_model)
    flight = Flight(
        number=1,
        gains=experiment.space.mapping(default),
        trajectory=flown,
        error=experiment.error(flown),
        outcome="valid",
    )
    compute(CampaignHistory(definition=definition, flights=(flight,), digest=""))
