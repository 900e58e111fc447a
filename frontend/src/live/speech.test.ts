import { expect, test } from "vitest";
import { justDown, type News, newsSentences, outcomeSentence } from "./speech";
import { statusFrom, type VehicleStatus } from "./vehicleStatus";

const KNOWN = () => ({ name: "Bee", minBatteryV: 10.5 });

function status(fields: Record<string, unknown>): VehicleStatus {
  const found = statusFrom(
    JSON.stringify({ vehicle_id: 1, state: "connected", step: "idle", armed: false, ...fields }),
  );
  if (found === null) throw new Error("that is a status");
  return found;
}

function news(fields: Partial<News> = {}): News {
  return { state: "live", flights: new Map(), vehicles: new Map(), ...fields };
}

function of(fields: Record<string, unknown>): News {
  return news({ vehicles: new Map([[1, { status: status(fields) }]]) });
}

function flight(phase: string, timeS: number[] = []): News {
  return news({ flights: new Map([[5, { phase, timeS }]]) });
}

function said(before: News, now: News): string[] {
  return newsSentences(before, now, KNOWN).map(({ text }) => text);
}

test("a flight is announced from its gains to its take-off", () => {
  expect(said(news(), flight("staging"))).toEqual(["Staging."]);
  expect(said(flight("staging"), flight("staged"))).toEqual(["Staged, ready to fly."]);
  expect(said(flight("staged"), flight("flying"))).toEqual(["Taking off."]);
  expect(said(flight("flying"), flight("flying", [1, 2]))).toEqual([]);
});

test("a page that is opened in the middle of a flight does not say that it takes off", () => {
  expect(said(news(), flight("flying", [7.2]))).toEqual([]);
  expect(said(news(), of({ step: "record", armed: true, battery_v: 9 }))).toEqual([]);
});

test("what the vehicle does is said once, and what is wrong with it at once", () => {
  expect(said(of({}), of({ armed: true, step: "arm" }))).toEqual(["Armed."]);
  expect(said(of({ step: "arm" }), of({ step: "take-off" }))).toEqual(["Taking off."]);
  expect(newsSentences(of({ step: "record" }), of({ step: "abort-land" }), KNOWN)).toEqual([
    { text: "Aborted, landing.", urgent: true },
  ]);
  expect(said(of({}), of({ state: "gone" }))).toEqual(["Link to Bee lost."]);
  expect(said(of({ state: "gone" }), of({}))).toEqual(["Link to Bee is back."]);
  expect(said(of({}), of({ state: "not answering" }))).toEqual(["Commands do not reach Bee. Use the remote control."]);
  expect(said(of({ state: "not answering" }), of({}))).toEqual(["Link to Bee is back."]);
  expect(said(of({ battery_v: 10.6 }), of({ battery_v: 10.4 }))).toEqual(["Battery low, 10.4 volts."]);
  expect(said(of({ battery_v: 10.4 }), of({ battery_v: 10.3 }))).toEqual([]);
});

test("a server that goes away is told, one that has not been reached yet is not", () => {
  expect(said(news(), news({ state: "away" }))).toEqual(["The server is not responding."]);
  expect(said(news({ state: "connecting" }), news({ state: "away" }))).toEqual([]);
});

test("a flight that has ended is looked up once", () => {
  expect(justDown(flight("flying"), flight("landed"))).toEqual([5]);
  expect(justDown(flight("landed"), flight("ended"))).toEqual([]);
  expect(justDown(flight("staged"), flight("ended"))).toEqual([]);
});

test("the outcome is said with its error in words", () => {
  expect(outcomeSentence("captured", 0.2412, "m", false)?.text).toBe("Landed, needs review, 0.24 metres.");
  expect(outcomeSentence("aborted", 1.2, "m", false)).toEqual({ text: "Flight aborted.", urgent: true });
  expect(outcomeSentence("valid", 0.0123, "rad·s", false)?.text).toBe("Landed, valid, 0.012 radian seconds.");
  expect(outcomeSentence("flying", null, "m", false)).toBeNull();
});

test("a vehicle that its pilot has taken over in the air is not said to have landed", () => {
  const said = outcomeSentence("invalid", null, "m", true);
  expect(said).toEqual({ text: "Flight over, but the vehicle is still armed.", urgent: true });
});
