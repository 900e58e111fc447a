import { expect, test } from "vitest";
import type { CampaignStatistics } from "../../../api/types";
import { isPriorScatter } from "./scatter";

test("a scatter without a repeated gain set is named as the prior's", () => {
  const group = (...errors: number[]) => ({ errors }) as unknown as CampaignStatistics["groups"][number];
  expect(isPriorScatter({ sigma: 0.01, groups: [group(0.3), group(0.1)] })).toBe(true);
  expect(isPriorScatter({ sigma: 0.01, groups: [group(0.3, 0.31), group(0.1)] })).toBe(false);
});
