/** Alternatives to the proposed gains, and the recommended one. */

import type { Campaign, CampaignStatistics, Proposal, Trial } from "../../api/types";
import { gainsInBrackets } from "../../ui/gains";
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
  manual: "Manual",
  none: "No better gains found",
};

export const RECOMMENDED: Record<Recommended, string> = {
  step: "Fly the step",
  repeat: "Repeat the best",
  baseline: "Fly the baseline",
  stop: "Stop the campaign",
};

type GainSet = Readonly<Record<string, number>>;

export function sameGains(one: GainSet, other: GainSet): boolean {
  const names = Object.keys(one);
  return names.length === Object.keys(other).length && names.every((name) => one[name] === other[name]);
}

export interface Advised {
  kind: Recommended;
  why: string;
  gains: GainSet;
  /** The recommended variant; null if the proposal itself or no flight is recommended. */
  variant: Variant | null;
}

/** The recommendation: the proposal, one of its variants, or the end of the campaign. */
export function advised(proposal: Proposal): Advised {
  const { advice } = proposal;
  const kind = advice?.kind ?? proposal.recommended;
  const why = advice?.why ?? (kind === "stop" ? proposal.stop_verdict.sentence : "");
  const differs = advice !== null && advice !== undefined && !sameGains(advice.gains, proposal.gains);
  const variant = differs && (kind === "repeat" || kind === "baseline") ? kind : null;
  return { kind, why, gains: advice?.gains ?? proposal.gains, variant };
}

/** Each gain now and as in this set, with its change. */
export function changesTo(gains: GainSet, { changes }: Proposal): Proposal["changes"] {
  return Object.fromEntries(
    Object.entries(changes).map(([name, { now, next: proposed }]) => {
      const next = gains[name] ?? proposed;
      return [name, { now, next, delta: next - now }];
    }),
  );
}

export interface Choice {
  variant: Variant;
  label: string;
  hint: string;
}

/** The variants that differ from the proposal and from each other. */
export function choicesFor(campaign: Campaign, proposal: Proposal, trials: readonly Trial[]): Choice[] {
  const best = bestOf(campaign, trials);
  const first = trials.find((trial) => trial.state === "valid") ?? null;
  if (best === null || first === null) return [];
  const choices: Choice[] = [];
  const isNew = !trials.some((trial) => trial.state === "valid" && sameGains(trial.gains, proposal.gains));
  if (isNew) {
    choices.push({ variant: "smaller step", label: "Smaller step", hint: "Halfway from the best gains to these" });
  }
  if (!sameGains(best.gains, proposal.gains)) {
    choices.push({
      variant: "repeat",
      label: "Repeat instead",
      hint: "Flies the best gains again to check their result",
    });
  }
  if (!sameGains(first.gains, proposal.gains) && !sameGains(first.gains, best.gains)) {
    choices.push({
      variant: "baseline",
      label: "Baseline",
      hint: `Flies the first gains (flight ${first.number}) again to check for drift`,
    });
  }
  return choices;
}

/** Expected error of a variant: from earlier flights with its gains; none for half a step. */
export function expectationOf(variant: Variant, statistics: CampaignStatistics | undefined): string {
  if (variant === "smaller step") return "Halfway from the best gains to these. No prediction.";
  const group = statistics?.groups.find((one) => (variant === "repeat" ? one.is_best : one.is_baseline));
  if (statistics === undefined || group === undefined) return "";
  const flights = `flight${group.trial_numbers.length === 1 ? "" : "s"} ${group.trial_numbers.join(", ")}`;
  const error = plusMinus(group.mean, statistics.sigma, statistics.error_unit);
  const meaning = statistics.sigma === null ? "scatter not known yet" : "± scatter of one flight";
  return `${gainsInBrackets(group.gains)}, expected ${error}, from ${flights} (${meaning}).`;
}
