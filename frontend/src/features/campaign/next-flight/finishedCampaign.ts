/** Why a campaign ended, the flights that would confirm its result, and its gains on the vehicle. */

import type { Campaign, CampaignStatistics, RepeatGroup } from "../../../api/types";
import { count } from "../../../ui/format";

type Gains = Readonly<Record<string, number>>;
type Repeated = Pick<RepeatGroup, "errors"> | undefined;
type Variant = "repeat" | "baseline";

/** The flights that are missing until the best and the first gains have each flown twice. */
export function confirmationOf(winner: Repeated, first: Repeated): Variant[] {
  const missing = (variant: Variant, group: Repeated) =>
    Array<Variant>(Math.max(0, 2 - (group?.errors.length ?? 2))).fill(variant);
  return [...missing("repeat", winner), ...missing("baseline", first)];
}

/** What the flights of a confirmation are for. */
export function confirmationText(plan: readonly Variant[]): string {
  const of = (variant: Variant, gains: string) => {
    const flights = plan.filter((one) => one === variant).length;
    return flights === 0 ? [] : [`${count(flights, "more flight")} with the ${gains} gains`];
  };
  const parts = [...of("repeat", "best"), ...of("baseline", "first")];
  return `The best and the first gains must each be flown at least twice: ${parts.join(" and ")}.`;
}

/** Why the campaign ended, without the verdict, which is shown beside it. */
export function endingOf(
  { stop_reason: reason }: Pick<Campaign, "stop_reason">,
  comparison: Pick<NonNullable<CampaignStatistics["comparison"]>, "sentence"> | null,
): string {
  return comparison === null ? reason : reason.replace(comparison.sentence, "").replaceAll("  ", " ").trim();
}

/** A gain to load: the first flight's value, the new one, and that on the vehicle, undefined if it is not known. */
export interface GainToLoad {
  name: string;
  old: number | undefined;
  value: number;
  held: number | undefined;
  isOnVehicle: boolean;
}

/** A parameter file has six digits. */
const FILE_PRECISION = 1e-5;

/** The best gains beside the first flight's and those that the vehicle holds. */
export function gainsToLoad(best: Gains, first: Gains, held: Gains): GainToLoad[] {
  return Object.entries(best).map(([name, value]) => {
    const onBoard = held[name];
    const isOnVehicle = onBoard !== undefined && Math.abs(onBoard - value) <= FILE_PRECISION * Math.abs(value);
    return { name, old: first[name], value, held: onBoard, isOnVehicle };
  });
}
