import { expect, test } from "vitest";
import type { Trial } from "../../api/types";
import { suggestedClass } from "./review";

test("a class is suggested from how the record ended, with its reason", () => {
  const record = { ending: "completed" } as Trial["record"] & object;
  const landed = { state: "captured", record, glitches: [], reason: "" } as const;
  expect(suggestedClass({ ...landed, glitches: [] })?.outcome).toBe("valid");
  expect(suggestedClass({ ...landed, glitches: [{} as Trial["glitches"][number]] })?.why).toContain("1 glitch");
  const doubted = {
    ...landed,
    glitches: [],
    record: { ...record, ending: "invalid" as const },
    reason: "clock jumped",
  };
  expect(suggestedClass(doubted)).toEqual({ outcome: "invalid", why: "clock jumped" });
  expect(suggestedClass({ ...landed, glitches: [], state: "valid" })).toBeNull();
  expect(suggestedClass({ ...landed, glitches: [], record: null, state: "lost" })?.outcome).toBe("invalid");
});
