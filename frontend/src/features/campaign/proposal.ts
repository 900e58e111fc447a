/** What can be flown next instead of, or beside, what is proposed. */

import type { Campaign, CampaignStatistics, Proposal, Trial } from "../../api/types";
import { plusMinus } from "../../ui/uncertainty";
import { bestOf } from "./nextStep";

export type Recommended = Proposal["recommended"];
export type Variant = "smaller step" | "repeat" | "baseline";

export const KINDS: Record<Proposal["kind"], string> = {
  start: "Start",
  step: "Step",
  "shorter step": "Shorter step",
  repeat: "Repeat",
  baseline: "Baseline",
  manual: "By hand",
  none: "Nothing better found",
};

export const RECOMMENDED: Record<Recommended, string> = {
  step: "Fly the step",
  repeat: "Repeat the best",
  baseline: "Fly the baseline",
  stop: "Stop here",
};

type GainSet = Readonly<Record<string, number>>;

export function sameGains(one: GainSet, other: GainSet): boolean {
  const names = Object.keys(one);
  return names.length === Object.keys(other).length && names.every((name) => one[name] === other[name]);
}

export interface Advised {
  kind: Recommended;
  why: string;
  /** The variant that flies what is advised; null when the proposal itself does, or when nothing is to be flown. */
  variant: Variant | null;
}

/** The one recommended thing: the proposal, one of its variants, or an end. */
export function advised(proposal: Proposal): Advised {
  const { advice } = proposal;
  const kind = advice?.kind ?? proposal.recommended;
  const why = advice?.why ?? (kind === "stop" ? proposal.stop_verdict.sentence : "");
  const differs = advice !== null && advice !== undefined && !sameGains(advice.gains, proposal.gains);
  const variant = differs && (kind === "repeat" || kind === "baseline") ? kind : null;
  return { kind, why, variant };
}

export interface Choice {
  variant: Variant;
  label: string;
  hint: string;
}

/** The variants that would fly something else than the proposal; none is offered that means the same twice. */
export function choicesFor(campaign: Campaign, proposal: Proposal, trials: readonly Trial[]): Choice[] {
  const best = bestOf(campaign, trials);
  const first = trials.find((trial) => trial.state === "valid") ?? null;
  if (best === null || first === null) return [];
  const choices: Choice[] = [];
  const isNew = !trials.some((trial) => trial.state === "valid" && sameGains(trial.gains, proposal.gains));
  if (isNew) {
    choices.push({ variant: "smaller step", label: "Smaller step", hint: "Half way from the best gains to these" });
  }
  if (!sameGains(best.gains, proposal.gains)) {
    choices.push({
      variant: "repeat",
      label: "Repeat instead",
      hint: "The best gains once more: was it luck?",
    });
  }
  if (!sameGains(first.gains, proposal.gains) && !sameGains(first.gains, best.gains)) {
    choices.push({
      variant: "baseline",
      label: "Baseline",
      hint: `The gains of flight ${first.number}, the first, once more: has the vehicle changed?`,
    });
  }
  return choices;
}

/** What a variant should score: flights of gains that were flown before say it themselves, half a step nobody does. */
export function expectationOf(variant: Variant, statistics: CampaignStatistics | undefined): string {
  if (variant === "smaller step") return "Half way from the best gains to these. No prediction is made for it.";
  const group = statistics?.groups.find((one) => (variant === "repeat" ? one.is_best : one.is_baseline));
  if (statistics === undefined || group === undefined) return "";
  const flights = `flight${group.trial_numbers.length === 1 ? "" : "s"} ${group.trial_numbers.join(", ")}`;
  const error = plusMinus(group.mean, statistics.sigma, statistics.error_unit);
  const meaning = statistics.sigma === null ? "how much flights scatter is not known yet" : "± scatter of one flight";
  return `Expected: ${error}, as ${flights} (${meaning}).`;
}
