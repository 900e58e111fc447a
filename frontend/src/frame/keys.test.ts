import { expect, test } from "vitest";
import { abortTargets, commandOf, keysOf } from "./keys";

const press = (key: string, more: Partial<KeyboardEvent> = {}) =>
  ({ key, ctrlKey: false, metaKey: false, altKey: false, ...more }) as KeyboardEvent;

test("a key asks for something unless one types, or the browser has it", () => {
  expect(commandOf(press("?"), false)).toBe("help");
  expect(commandOf(press("/"), false)).toBe("search");
  expect(commandOf(press("?"), true)).toBeNull();
  expect(commandOf(press("/", { ctrlKey: true }), false)).toBeNull();
  expect(commandOf(press("a"), false)).toBeNull();
  const commands = [..."jkxc"].map((key) => commandOf(press(key), false));
  expect(commands).toEqual(["next", "previous", "select", "compare"]);
});

test("a page's own keys come before those of every page, and abort is on every page", () => {
  const words = (path: string) => keysOf(path).map(({ keys }) => keys.join(" "));
  expect(words("/")).toEqual(["/", "Space", "Tab", "Enter", "Esc", "?"]);
  expect(words("/campaigns/3").slice(0, 4)).toEqual(["j k", "x", "c", "← →"]);
  expect(words("/campaigns/3/flights/7").slice(0, 2)).toEqual(["j k", "← →"]);
  expect(words("/fly/3")[0]).toBe("Space");
});

const flying = [
  { campaignId: 1, trialId: 11 },
  { campaignId: 2, trialId: 22 },
];

test("Space aborts the flight that one looks at", () => {
  expect(abortTargets(flying, 2)).toEqual([{ campaignId: 2, trialId: 22 }]);
});

test("Space aborts everything when the page shows no flight", () => {
  expect(abortTargets(flying, null)).toEqual(flying);
  expect(abortTargets(flying, 7)).toEqual(flying);
  expect(abortTargets([], 7)).toEqual([]);
});
