/** Labels of states, and their tone. */

import type { Campaign, CampaignState, TrialState } from "../api/types";

export type Tone = "quiet" | "good" | "busy" | "bad";

export interface StateLabel {
  word: string;
  tone: Tone;
}

const inTone =
  (tone: Tone) =>
  (word: string): StateLabel => ({ word, tone });

export const quiet = inTone("quiet");
export const good = inTone("good");
export const busy = inTone("busy");
export const bad = inTone("bad");

const CAMPAIGN: Record<CampaignState, StateLabel> = {
  draft: busy("Preparing"),
  ready: quiet("Not flown yet"),
  flying: busy("In flight"),
  deciding: quiet("Between flights"),
  finished: good("Finished"),
  archived: quiet("Archived"),
};

const OUTCOME: Record<string, StateLabel> = {
  converged: good("Converged"),
  budget: good("Flight budget used"),
  stopped: quiet("Stopped"),
};

/** Of a campaign that converged without other gains that compare better: its first gains are its best. */
const NOTHING_BETTER: StateLabel = quiet("No better gains found");

type RehearsalState = Campaign["rehearsal"]["state"];

/** Labels of a real vehicle's campaign that waits for its rehearsal. */
const REHEARSAL: Partial<Record<RehearsalState, StateLabel>> = {
  missing: quiet("Rehearsal required"),
  "under way": busy("Rehearsal in progress"),
  failed: bad("Rehearsal failed"),
};

interface Standing extends Pick<Campaign, "state" | "outcome" | "verdict"> {
  vehicle: Pick<Campaign["vehicle"], "can_fly" | "state">;
  rehearsal?: RehearsalState;
  /** Whether the campaign is a rehearsal that has passed. */
  hasPassed?: boolean;
}

export function campaignStateLabel({
  state,
  outcome,
  verdict,
  vehicle,
  rehearsal = "not needed",
  hasPassed = false,
}: Standing): StateLabel {
  if (state === "finished" && outcome === "converged" && verdict === null) return NOTHING_BETTER;
  if (state === "finished" && outcome !== null) return OUTCOME[outcome] ?? CAMPAIGN.finished;
  const mayFly = state === "ready" || state === "deciding";
  if (mayFly && vehicle.state === "quarantined") return bad("Vehicle quarantined");
  if (mayFly && hasPassed) return good("Rehearsal passed");
  if (mayFly && REHEARSAL[rehearsal]) return REHEARSAL[rehearsal];
  return state === "ready" && !vehicle.can_fly ? quiet("Ready") : CAMPAIGN[state];
}

const TRIAL: Record<TrialState, StateLabel> = {
  planned: quiet("Planned"),
  staged: busy("Staged"),
  flying: busy("In flight"),
  captured: busy("Needs review"),
  valid: good("Valid"),
  aborted: bad("Aborted"),
  invalid: bad("Invalid"),
  cancelled: quiet("Cancelled"),
  lost: bad("Lost"),
};

export function trialStateLabel(state: TrialState): StateLabel {
  return TRIAL[state];
}

/** States of trials that have flown. */
const FLOWN: readonly TrialState[] = ["captured", "valid", "aborted", "invalid", "lost"];

export function wasFlown(state: TrialState): boolean {
  return FLOWN.includes(state);
}
