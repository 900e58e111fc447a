/** The next action in a campaign, which the right-hand card of its page shows. */

import type { Campaign, NextFlight, Proposal, Trial, Trouble } from "../../../api/types";
import type { LiveFlight } from "../../../live/telemetry";
import { wasFlown } from "../../../ui/states";

export type NextStep =
  | { kind: "flying"; flight: NonNullable<Campaign["flying"]> }
  | { kind: "judge"; trial: Trial }
  | { kind: "rehearse" }
  | { kind: "planned"; trial: Trial }
  | { kind: "propose"; proposal: Proposal }
  | { kind: "computing" }
  | { kind: "failed"; problem: Trouble | null }
  | { kind: "finished" };

export const STAGED = "Staged, waiting for takeoff";

/** How far the flight in progress has come. The event stream may be ahead of the stored state. */
export function flyingStage(trial: Trial | undefined, live: Pick<LiveFlight, "phase" | "timeS"> | null): string {
  const waits = trial?.state === "staged" && trial.flight?.mode === "stage" && trial.flight.take_off_at === null;
  if (waits && live?.phase !== "flying") return STAGED;
  if (trial?.state === "flying" || live?.phase === "flying" || live?.timeS.length) return "In flight";
  return trial?.state === "planned" ? "Waiting for the worker" : "Staging";
}

/** Whether the flight in progress has landed according to the list of flights. */
export function hasLanded({ flying }: Campaign, trials: readonly Trial[]): boolean {
  return flying !== null && trials.some(({ id, state }) => id === flying.trial_id && wasFlown(state));
}

export function nextStep(campaign: Campaign, next: NextFlight, trials: readonly Trial[]): NextStep {
  const { flying } = campaign;
  const landed = hasLanded(campaign, trials);
  if (flying !== null && !landed) return { kind: "flying", flight: flying };
  const unjudged = trials.find((trial) => trial.state === "captured" || trial.state === "lost");
  if (unjudged !== undefined) return { kind: "judge", trial: unjudged };
  // The list of flights is newer than the campaign: the campaign and its proposal are stale.
  if (landed) return { kind: "computing" };
  if (campaign.state === "finished" || campaign.state === "archived") return { kind: "finished" };
  if (wantsRehearsal(campaign)) return { kind: "rehearse" };
  const planned = trials.find((trial) => trial.state === "planned" || trial.state === "staged");
  if (planned !== undefined) return { kind: "planned", trial: planned };
  if (next.state === "failed" || next.state === "none") return { kind: "failed", problem: next.problem };
  const { proposal } = next;
  return proposal === null || proposal.stale || next.state !== "ready"
    ? { kind: "computing" }
    : { kind: "propose", proposal };
}

/** Whether the campaign must pass a rehearsal before its real vehicle may fly. */
export function wantsRehearsal({ rehearsal }: Campaign): boolean {
  return rehearsal.state !== "not needed" && rehearsal.state !== "passed";
}

/** Shows the top of the page, where the flight is watched, once it has begun; a refusal is told where it was ordered. */
export function scrollUpOnceBegun(flight: Promise<unknown>): void {
  flight.then(
    () => window.scrollTo({ top: 0 }),
    () => undefined,
  );
}

/** Whether the operator withdrew the last flight before it took off, as by unstaging. */
export function isWithdrawnByOperator({ flight }: Pick<Trial, "flight">): boolean {
  return flight !== null && flight.state === "cancelled" && flight.end?.request?.by === "operator";
}
