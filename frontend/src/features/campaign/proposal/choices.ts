/** What may be flown next: the proposal, its variants, or custom gains. */

import type { GainSet } from "../../../api/evaluation";
import type { FlightChoice, NewTrial, Proposal, RepeatGroup } from "../../../api/types";
import { flightsText } from "../../../ui/format";

export type ChoiceName = FlightChoice["kind"] | "own";

export const CHOICES: Record<ChoiceName, { label: string; hint: string }> = {
  step: { label: "Step", hint: "The gains that the strategy proposes." },
  "smaller step": { label: "Smaller step", hint: "Halfway from the best gains to the proposed ones." },
  repeat: { label: "Repeat", hint: "Flies the best gains again to see whether the result was luck." },
  baseline: { label: "Baseline", hint: "Flies the first gains again to check whether the vehicle has changed." },
  own: { label: "Custom gains", hint: "" },
};

/** Whether a choice flies gains again, so that its interval is the scatter's. */
export function isRepeat(name: ChoiceName): boolean {
  return name === "repeat" || name === "baseline";
}

/** The recommended choice; without one the proposal's own. */
export function preselected({ choices }: Proposal): ChoiceName {
  return (choices.find(({ recommended }) => recommended) ?? choices.find(({ proposed }) => proposed))?.kind ?? "own";
}

/** Whether the start gains are offered again although a flight with them was aborted because of them. */
export function isDoubtful({ kind, choices }: Pick<Proposal, "kind" | "choices">): boolean {
  return kind === "start" && !choices.some((choice) => choice.recommended);
}

/** The flights of these gains, whose mean is the prediction of a repeat. */
export function repeatSource(name: ChoiceName, group: Pick<RepeatGroup, "trial_numbers"> | undefined): string {
  if (!isRepeat(name) || group === undefined) return "";
  return `${group.trial_numbers.length > 1 ? "mean" : "error"} of ${flightsText(group.trial_numbers)} with these gains`;
}

/** What to fly, without how: the proposal, a variant with the gains that are shown, or custom gains. */
export function trialOf(proposal: Proposal, choice: FlightChoice | undefined, gains: GainSet): NewTrial {
  if (choice === undefined) return { gains };
  if (choice.proposed) return { proposal_id: proposal.id };
  return choice.kind === "step" ? { gains } : { variant: choice.kind, gains };
}
