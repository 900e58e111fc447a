/** What a landed flight most likely is: a suggestion for the person who reviews it. */

import type { Trial } from "../../api/types";

export interface Suggestion {
  outcome: "valid" | "aborted" | "invalid";
  why: string;
}

/** What a landed flight most likely is, and why; a person says it. */
export function suggestedClass(trial: Pick<Trial, "state" | "record" | "glitches" | "reason">): Suggestion | null {
  if (trial.state === "lost") return { outcome: "invalid", why: trial.reason || "nobody knows how it ended" };
  if (trial.state !== "captured" || trial.record === null) return null;
  switch (trial.record.ending) {
    case "invalid":
      return { outcome: "invalid", why: trial.reason || "the measurement is no good" };
    case "aborted":
      return { outcome: "aborted", why: trial.reason || "the flight was broken off" };
    case "completed": {
      const glitches = trial.glitches.length;
      if (glitches === 0) return { outcome: "valid", why: "the record is complete and without glitches" };
      return { outcome: "invalid", why: `the record has ${glitches} glitch${glitches === 1 ? "" : "es"}` };
    }
  }
}
