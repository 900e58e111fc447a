/** Labels of states, and their tone. */

import type { Campaign, CampaignState, TrialState } from "../api/types";

export type Tone = "quiet" | "good" | "busy" | "bad";

export interface StateLabel {
  word: string;
  tone: Tone;
}

const CAMPAIGN: Record<CampaignState, StateLabel> = {
  draft: { word: "Preparing", tone: "busy" },
  ready: { word: "Not flown yet", tone: "quiet" },
  flying: { word: "In flight", tone: "busy" },
  deciding: { word: "Between flights", tone: "quiet" },
  finished: { word: "Finished", tone: "good" },
  archived: { word: "Archived", tone: "quiet" },
};

const OUTCOME: Record<string, StateLabel> = {
  converged: { word: "Converged", tone: "good" },
  budget: { word: "Flight budget used", tone: "good" },
  stopped: { word: "Stopped", tone: "quiet" },
};

/** Of a campaign that converged without other gains that compare better: its first gains are its best. */
const NOTHING_BETTER: StateLabel = { word: "No better gains found", tone: "quiet" };

type RehearsalState = Campaign["rehearsal"]["state"];

/** Labels of a real vehicle's campaign that waits for its rehearsal. */
const REHEARSAL: Partial<Record<RehearsalState, StateLabel>> = {
  missing: { word: "Rehearsal required", tone: "quiet" },
  "under way": { word: "Rehearsal in progress", tone: "busy" },
  failed: { word: "Rehearsal failed", tone: "bad" },
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
  if (mayFly && vehicle.state === "quarantined") return { word: "Vehicle quarantined", tone: "bad" };
  if (mayFly && hasPassed) return { word: "Rehearsal passed", tone: "good" };
  if (mayFly && REHEARSAL[rehearsal]) return REHEARSAL[rehearsal];
  return state === "ready" && !vehicle.can_fly ? { word: "Ready", tone: "quiet" } : CAMPAIGN[state];
}

const TRIAL: Record<TrialState, StateLabel> = {
  planned: { word: "Planned", tone: "quiet" },
  staged: { word: "Staged", tone: "busy" },
  flying: { word: "In flight", tone: "busy" },
  captured: { word: "Needs review", tone: "busy" },
  valid: { word: "Valid", tone: "good" },
  aborted: { word: "Aborted", tone: "bad" },
  invalid: { word: "Invalid", tone: "bad" },
  cancelled: { word: "Cancelled", tone: "quiet" },
  lost: { word: "Lost", tone: "bad" },
};

export function trialStateLabel(state: TrialState): StateLabel {
  return TRIAL[state];
}

/** States of trials that have flown. */
const FLOWN: ReadonlySet<TrialState> = new Set<TrialState>(["captured", "valid", "aborted", "invalid", "lost"]);

export function wasFlown(state: TrialState): boolean {
  return FLOWN.has(state);
}
