/** The one thing to do next in a campaign: what the right-hand card of its page shows. */

import type { Campaign, NextFlight, Proposal, Trial, Trouble } from "../../api/types";
import { wasFlown } from "../../ui/states";

export type NextStep =
  | { kind: "flying"; trialId: number; trialNumber: number }
  | { kind: "judge"; trial: Trial }
  | { kind: "rehearse" }
  | { kind: "planned"; trial: Trial }
  | { kind: "propose"; proposal: Proposal }
  | { kind: "nothing better"; proposal: Proposal }
  | { kind: "computing" }
  | { kind: "failed"; problem: Trouble | null }
  | { kind: "finished" };

/** Whether what the campaign knows as flying is down by its list of flights. */
export function hasLanded({ flying }: Campaign, trials: readonly Trial[]): boolean {
  return flying !== null && trials.some(({ id, state }) => id === flying.trial_id && wasFlown(state));
}

export function nextStep(campaign: Campaign, next: NextFlight, trials: readonly Trial[]): NextStep {
  const { flying } = campaign;
  const landed = hasLanded(campaign, trials);
  if (flying !== null && !landed) {
    return { kind: "flying", trialId: flying.trial_id, trialNumber: flying.trial_number };
  }
  const unjudged = trials.find((trial) => trial.state === "captured" || trial.state === "lost");
  if (unjudged !== undefined) return { kind: "judge", trial: unjudged };
  // The list of flights has come before the campaign that it belongs to: neither it nor its proposal is up to date.
  if (landed) return { kind: "computing" };
  if (campaign.state === "finished" || campaign.state === "archived") return { kind: "finished" };
  if (wantsRehearsal(campaign)) return { kind: "rehearse" };
  const planned = trials.find((trial) => trial.state === "planned" || trial.state === "staged");
  if (planned !== undefined) return { kind: "planned", trial: planned };
  if (next.state === "failed" || next.state === "none") return { kind: "failed", problem: next.problem };
  if (next.state === "ready" && next.proposal !== null && !next.proposal.stale) return offered(next.proposal);
  return { kind: "computing" };
}

/** Whether its real vehicle may not fly before the campaign has flown on a simulation. */
export function wantsRehearsal({ rehearsal }: Campaign): boolean {
  return rehearsal.state !== "not needed" && rehearsal.state !== "passed";
}

function offered(proposal: Proposal): NextStep {
  if (proposal.kind === "none" || proposal.recommended === "stop") return { kind: "nothing better", proposal };
  return { kind: "propose", proposal };
}

/** Simulated time over wall time; null is as fast as the machine can. */
export type Speed = 1 | 10 | null;

export const SPEEDS: readonly { value: string; label: string; speed: Speed }[] = [
  { value: "1", label: "1×", speed: 1 },
  { value: "10", label: "10×", speed: 10 },
  { value: "max", label: "Max", speed: null },
];

export function speedOf(value: string): Speed {
  const found = SPEEDS.find((one) => one.value === value);
  return found === undefined ? 10 : found.speed;
}

/** The trial of the campaign's best flight. */
export function bestOf(campaign: Campaign, trials: readonly Trial[]): Trial | null {
  return trials.find((trial) => trial.id === campaign.best?.trial_id) ?? null;
}
