/** Spoken announcements for changes of the event stream. */

import { hasLanded, type LiveFlight } from "./telemetry";
import type { LastHeard, VehicleStatus } from "./vehicleStatus";

/** State of the event stream. */
export interface News {
  state: "connecting" | "live" | "away";
  flights: ReadonlyMap<number, Pick<LiveFlight, "phase" | "timeS">>;
  vehicles: ReadonlyMap<number, Pick<LastHeard, "status">>;
}

/** Facts about a vehicle that the stream does not contain. */
export interface Known {
  name: string;
  minBatteryV: number | null;
}

export interface Sentence {
  text: string;
  /** Interrupts the current sentence. */
  urgent: boolean;
}

const say = (text: string): Sentence => ({ text, urgent: false });
const shout = (text: string): Sentence => ({ text, urgent: true });

const PHASES: Readonly<Record<string, Sentence>> = {
  staging: say("Staging."),
  staged: say("Staged, ready to fly."),
  flying: say("Taking off."),
};

const STEPS: Readonly<Record<string, Sentence>> = {
  "take-off": say("Taking off."),
  land: say("Landing."),
  "abort-land": shout("Aborted, landing."),
  "link lost": shout("Link lost."),
  quarantined: shout("Quarantined. Inspect the vehicle."),
};

const LANDING_UNHEARD = shout("Landing after link loss.");

const UNITS: Readonly<Record<string, { word: string; digits: number }>> = {
  m: { word: "metres", digits: 2 },
  V: { word: "volts", digits: 1 },
  rad·s: { word: "radian seconds", digits: 3 },
};

function aloud(value: number, unit: string): string {
  const { word, digits } = UNITS[unit] ?? { word: unit, digits: 3 };
  return `${value.toFixed(digits)} ${word}`;
}

/** Announcements for changes; none for what was so when the page was opened. */
export function newsSentences(before: News, now: News, known: (vehicleId: number) => Known): Sentence[] {
  const said: Sentence[] = [];
  if (before.state === "live" && now.state === "away") said.push(shout("The server is not responding."));
  for (const [trialId, { phase, timeS }] of now.flights) {
    const earlier = before.flights.get(trialId)?.phase;
    const isNew = phase !== earlier && (earlier !== undefined || timeS.length === 0);
    if (isNew && PHASES[phase] !== undefined) said.push(PHASES[phase]);
  }
  for (const [vehicleId, { status }] of now.vehicles) {
    const earlier = before.vehicles.get(vehicleId)?.status;
    if (earlier !== undefined && earlier !== status) said.push(...statusSentences(earlier, status, known(vehicleId)));
  }
  return said;
}

function statusSentences(before: VehicleStatus, now: VehicleStatus, { name, minBatteryV }: Known): Sentence[] {
  const said: Sentence[] = [];
  if (before.state === "connected" && now.state === "gone") said.push(shout(`Link to ${name} lost.`));
  if (before.state !== "not answering" && now.state === "not answering")
    said.push(shout(`Commands do not reach ${name}. Use the remote control.`));
  if (before.state !== "connected" && before.state !== "connecting" && now.state === "connected")
    said.push(say(`Link to ${name} is back.`));
  if (before.armed === false && now.armed === true) said.push(say("Armed."));
  const step = before.step === "link lost" && now.step === "abort-land" ? LANDING_UNHEARD : STEPS[now.step];
  if (before.step !== now.step && step !== undefined) said.push(step);
  const wasLow = isLow(before.batteryV, minBatteryV);
  if (!wasLow && isLow(now.batteryV, minBatteryV)) said.push(shout(`Battery low, ${aloud(now.batteryV ?? 0, "V")}.`));
  return said;
}

function isLow(batteryV: number | null, minBatteryV: number | null): boolean {
  return batteryV !== null && minBatteryV !== null && batteryV < minBatteryV;
}

/** Trials whose flights have just ended. */
export function justDown(before: News, now: News): number[] {
  return [...now.flights].flatMap(([trialId, { phase }]) =>
    hasLanded(phase) && before.flights.get(trialId)?.phase === "flying" ? [trialId] : [],
  );
}

const OUTCOMES: Readonly<Record<string, Sentence>> = {
  captured: say("Landed, needs review"),
  valid: say("Landed, valid"),
  invalid: say("Landed, invalid"),
  aborted: shout("Flight aborted"),
  lost: shout("Flight outcome unknown. Inspect the vehicle"),
};

const NOT_LANDED: Sentence = shout("Flight over, but the vehicle is still armed.");

/**
 * `Landed, needs review, 0.24 metres.`; null until the result is stored. `isArmed`: whether the vehicle reports its
 * motors armed, as one that its pilot has taken over does.
 */
export function outcomeSentence(state: string, error: number | null, unit: string, isArmed: boolean): Sentence | null {
  const outcome = OUTCOMES[state];
  if (outcome === undefined) return null;
  if (isArmed) return NOT_LANDED;
  const tells = error !== null && (state === "captured" || state === "valid");
  return { ...outcome, text: `${outcome.text}${tells ? `, ${aloud(error, unit)}` : ""}.` };
}

/** Speak after the current sentence, or at once if urgent. Does nothing without speech synthesis. */
export function speak({ text, urgent }: Sentence): void {
  if (!("speechSynthesis" in window)) return;
  if (urgent) window.speechSynthesis.cancel();
  const words = new SpeechSynthesisUtterance(text);
  words.lang = "en";
  window.speechSynthesis.speak(words);
}
