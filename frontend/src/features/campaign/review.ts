/** Suggested class of a landed flight, for its review. */

import type { Trial } from "../../api/types";

export interface Suggestion {
  outcome: "valid" | "aborted" | "invalid";
  why: string;
}

/** Suggested class and its reason; the operator decides. */
export function suggestedClass(trial: Pick<Trial, "state" | "record" | "glitches" | "reason">): Suggestion | null {
  if (trial.state === "lost") return { outcome: "invalid", why: trial.reason || "the end of the flight is unknown" };
  if (trial.state !== "captured" || trial.record === null) return null;
  switch (trial.record.ending) {
    case "invalid":
      return { outcome: "invalid", why: trial.reason || "the measurement is unusable" };
    case "aborted":
      return { outcome: "aborted", why: trial.reason || "the flight was aborted" };
    case "completed": {
      const glitches = trial.glitches.length;
      if (glitches === 0) return { outcome: "valid", why: "the record is complete and without glitches" };
      return { outcome: "invalid", why: `the record has ${glitches} glitch${glitches === 1 ? "" : "es"}` };
    }
  }
}
