"""Computation of a proposal: pure and without the database, for compute processes."""

from dataclasses import dataclass

from app.autopilots.registry import evidence_of
from app.core.definition import Definition, Flight
from app.core.experiments.base import Experiment, ParameterDistribution
from app.core.experiments.takeoff import Takeoff
from app.core.tuning.campaign_models import known_distribution
from app.core.tuning.evidence import Evidence
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

    @property
    def evidence(self) -> Evidence[Experiment]:
        """The experiment, which has caches, is found anew in the process that computes."""
        return evidence_of(self.definition, self.flights, donor=self.donor, open_until_flight=self.open_until_flight)


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
    evidence = past.evidence
    proposal = next_proposal(evidence)
    stop_verdict = evaluate_stop_rule(evidence, proposal, battery_v=past.battery_v)
    spread = known_distribution(evidence) if proposal.spread is None else proposal.spread
    start = proposal.gains if proposal.kind == "start" else None
    return ProposalComputation(
        history_digest=past.digest,
        proposal=proposal,
        gate=check_policy(evidence, proposal.gains, start=start, spread=spread),
        spread=spread,
        flights=tuple(flight.number for flight in evidence.valid),
        stop_verdict=stop_verdict,
        advice=advise(evidence, proposal, stop_verdict),
    )


def warm_up() -> None:
    """Import and compile what a proposal needs, so that the first one is as fast as the others."""
    definition, experiment = Definition(), Takeoff()
    default = experiment.space.default
    flown = experiment.simulate(default, experiment.nominal_model)
    flight = experiment.scored_flight(1, experiment.space.mapping(default), flown)
    compute(CampaignHistory(definition=definition, flights=(flight,), digest=""))
