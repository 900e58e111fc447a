import { expect, test } from "vitest";
import type { TrialReadiness } from "../api/types";
import { hasEndedUnseen, type ReadinessStep, readinessNow } from "./readiness";

const CURRENT = { answerAgeS: 0.3, isServerAway: false, stalledS: 0 };
const AWAY = { ...CURRENT, isServerAway: true };
const UNANSWERED = { ...CURRENT, answerAgeS: 4.1 };
const STALLED = { ...CURRENT, stalledS: 12.4 };
const READY: TrialReadiness = { steps: ["control", "staged"], lost: [], losses: [], is_ready: true };

/** Every step that a flight can have reached, with a vehicle that answers. */
const STEPS: ReadinessStep[] = ["control", "staged", "held", "in flight", "landed", "reviewed"];
const REACHED: TrialReadiness[] = STEPS.map((_, index) => ({
  steps: STEPS.slice(0, index + 1),
  lost: [],
  losses: [],
  is_ready: index === 1,
}));

test("a current answer is what the page shows", () => {
  for (const answered of REACHED) expect(readinessNow(answered, CURRENT)).toBe(answered);
});

test.each([
  ["server away", AWAY],
  ["server away", UNANSWERED],
  ["page stalled", STALLED],
] as const)("before take-off, %s takes every step but control back", (kind, page) => {
  for (const answered of REACHED.slice(0, 3)) {
    const found = readinessNow(answered, page);
    expect([found.steps, found.lost, found.is_ready]).toEqual([["control"], answered.steps.slice(1), false]);
    expect(found.losses.map((loss) => loss.kind)).toEqual([kind]);
  }
});

test.each([AWAY, UNANSWERED, STALLED])("in flight nothing is taken back, and the way on is another one", (page) => {
  const [, , , flying] = REACHED;
  if (flying === undefined) throw new Error("there are six steps");
  const found = readinessNow(flying, page);
  expect([found.steps, found.lost, found.losses.length]).toEqual([flying.steps, [], 1]);
});

test.each([AWAY, UNANSWERED, STALLED])("after the landing there is nothing to take back or to say", (page) => {
  for (const answered of REACHED.slice(4)) expect(readinessNow(answered, page)).toBe(answered);
});

test("what the server has taken back stays so beside what the page takes back", () => {
  const silent: TrialReadiness = {
    steps: ["control"],
    lost: ["staged"],
    losses: [{ kind: "link silent", what: "Nothing has been received.", way_on: "Check its radio." }],
    is_ready: false,
  };
  const found = readinessNow(silent, AWAY);
  expect([found.steps, found.lost]).toEqual([["control"], ["staged"]]);
  expect(found.losses.map((loss) => loss.kind)).toEqual(["server away", "link silent"]);
});

test("a stalled page says for how long", () => {
  expect(readinessNow(READY, STALLED).losses[0]?.what).toContain("was frozen for 12 s");
});

test("control that ended by its lease is read again while the page still shows an operator", () => {
  const ended = { losses: [{ kind: "control ended" as const, what: "", way_on: "" }] };
  const shown = (operator: string | null) => [{ id: 1, control: operator === null ? null : { operator, until: "" } }];
  expect(hasEndedUnseen(ended, shown("Mia"), 1)).toBe(true);
  expect(hasEndedUnseen(ended, shown(null), 1)).toBe(false);
  expect(hasEndedUnseen({ losses: [] }, shown("Mia"), 1)).toBe(false);
  expect(hasEndedUnseen(ended, undefined, 1)).toBe(false);
});
