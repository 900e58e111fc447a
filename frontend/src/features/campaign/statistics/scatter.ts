/** What the flight-to-flight scatter is based on. */

import type { CampaignStatistics } from "../../../api/types";

/** Whether the scatter is only the prior estimate, because no gain set has two valid flights. */
export function isPriorScatter({ sigma, groups }: Pick<CampaignStatistics, "sigma" | "groups">): boolean {
  return sigma !== null && sigma > 0 && groups.every(({ errors }) => errors.length < 2);
}
