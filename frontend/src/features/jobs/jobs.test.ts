import { expect, test } from "vitest";
import type { Job, ReproductionRow } from "../../api/jobs";
import { between, comparedColumns, duration, jobTitle, measure, progressText, ratioSpan } from "./jobs";

const JOB: Job = {
  id: 3,
  kind: "reproduction",
  name: "table1",
  state: "running",
  campaign_id: null,
  campaign_name: null,
  problem: null,
  done_share: 0.387,
  doing: "jsbsim: 285, 44, 82 flown",
  remaining_s: 11.6,
  attempts: 1,
  created_at: "2026-11-21T07:00:00Z",
  started_at: "2026-11-21T07:00:01Z",
  finished_at: null,
  actions: ["cancel"],
};

function row(group: string, ratio: number | null): ReproductionRow {
  const rest = { unit: "m", digits: 4, measured: 1, paper: null, reference: null, note: "", gains: {}, numbers: {} };
  return { ...rest, group, label: "283, 13, 82", ratio, overruled: "" };
}

test("durations are as long as a person would say them", () => {
  expect(duration(0.42)).toBe("0.4 s");
  expect(duration(37.6)).toBe("38 s");
  expect(duration(125)).toBe("2 min 5 s");
  expect(duration(120)).toBe("2 min");
  expect(duration(4320)).toBe("1 h 12 min");
  expect(between("2026-11-21T07:00:00Z", "2026-11-21T07:01:04Z")).toBe("1 min 4 s");
});

test("progress says how far, what at, and how long still", () => {
  expect(progressText(JOB)).toBe("38\u00a0% · jsbsim: 285, 44, 82 flown · about 12 s left");
  expect(progressText({ ...JOB, remaining_s: null, doing: "" })).toBe("38\u00a0%");
  expect(progressText({ ...JOB, state: "queued" })).toBe("Queued");
});

test("a job is named after what it does", () => {
  const titles = new Map([["table1", "Table 1"]]);
  expect(jobTitle(JOB, titles)).toBe("Table 1");
  expect(jobTitle(JOB, new Map())).toBe("table1");
  const proposal: Job = { ...JOB, kind: "proposal", name: "", campaign_id: 4, campaign_name: "Twin, session 1" };
  expect(jobTitle(proposal, titles)).toBe("Proposal");
  expect(jobTitle({ ...proposal, kind: "landscape", name: "campaign 4" }, titles)).toBe("Error landscape");
});

test("the nearness to the paper is that of the first group with ratios", () => {
  const rows = [row("none", null), row("jsbsim", 0.864), row("jsbsim", 1.022), row("twin", 1.6)];
  expect(ratioSpan(rows)).toBe("0.86 to 1.02 times the published values");
  expect(ratioSpan([row("none", null)])).toBeNull();
});

test("a column that would be empty in every row is left out", () => {
  const recorded = { ...row("steps", null), paper: null, reference: 0 };
  expect(comparedColumns([recorded]).map(([, heading]) => heading)).toEqual(["Expected"]);
  const published = { ...row("jsbsim", 0.9), paper: 0.1, reference: null };
  expect(comparedColumns([recorded, published]).map(([key]) => key)).toEqual(["paper", "ratio", "reference"]);
});

test("numbers have their own digits and a proper minus", () => {
  expect(measure(-0.0111, 3)).toBe("−0.011");
  expect(measure(null, 3)).toBe("–");
});
