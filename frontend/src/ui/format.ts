/** Formatting of numbers and times: only significant digits, always with the unit. */

export const NOTHING = "–";

/** Decimals of an error: three, but at least two significant digits, of the smallest one that is not zero. */
export function errorDigits(...errors: readonly number[]): number {
  const least = Math.min(...errors.map(Math.abs).filter((error) => error > 0));
  return least < 0.0095 ? Math.min(6, 1 - Math.floor(Math.log10(least))) : 3;
}

/** With the digits of an error unless stated otherwise. */
export function withUnit(value: number | null | undefined, unit: string, digits = errorDigits(value ?? 0)): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  return `${trueMinus(value.toFixed(digits))}${unitAfter(unit)}`;
}

/** A number as text with a true minus, which a zero does not have. */
export function trueMinus(text: string): string {
  return /^-0(\.0*)?$/.test(text) ? text.slice(1) : text.replace(/^-/, "−");
}

/** A unit as it follows a number; nothing for a number without one, which the catalogue calls 1. A unit that begins with
 * a number is in brackets. */
export function unitAfter(unit: string): string {
  if (unit === "" || unit === "1") return "";
  return /^\d/.test(unit) ? ` (${unit})` : ` ${unit}`;
}

/** Signed change of `value` against `base` in percent; null if one is missing or the base is 0. */
export function percentChange(value: number | null | undefined, base: number | null | undefined): number | null {
  if (value === null || value === undefined || base === null || base === undefined || base === 0) return null;
  return (100 * (value - base)) / base;
}

/** `90 %`, with a no-break space. */
export function percentText(percent: number, digits = 0): string {
  return `${Number(percent.toFixed(digits))}\u00a0%`;
}

/** A change in percent as text: "59 % below the best"; from twice as much on "4.1 times the best". */
export function against(percent: number, base: string): string {
  if (percent > 100) return `${Number((1 + percent / 100).toPrecision(2))} times ${base}`;
  const size = percentText(Math.abs(percent));
  if (size === percentText(0)) return `the same as ${base}`;
  return `${size} ${percent < 0 ? "below" : "above"} ${base}`;
}

/** A gain: whole numbers as they are, others in four digits, with a true minus. */
export function gainText(value: number): string {
  const text = Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(4)));
  return trueMinus(text);
}

/** A text as a sentence: with a full stop, unless it ends with a punctuation mark. */
export function stopped(text: string): string {
  return /^$|[.!?…:]["”)]?$/.test(text) ? text : `${text}.`;
}

/** A text as a sentence of its own: with a capital letter and a full stop. */
export function asSentence(text: string): string {
  return stopped(text.charAt(0).toUpperCase() + text.slice(1));
}

/** Local date and time; with the year if it is not the current one. */
export function localTime(
  iso: string | null | undefined,
  { now = new Date(), seconds = false }: { now?: Date; seconds?: boolean } = {},
): string {
  if (!iso) return NOTHING;
  const at = new Date(iso);
  const year = at.getFullYear() === now.getFullYear() ? {} : ({ year: "numeric" } as const);
  const second = seconds ? ({ second: "2-digit" } as const) : {};
  const parts = { month: "short", day: "numeric", hour: "numeric", minute: "2-digit" } as const;
  return at.toLocaleString(undefined, { ...year, ...parts, ...second });
}

export function utcTime(iso: string): string {
  return `${new Date(iso).toISOString().slice(0, 19).replace("T", " ")} UTC`;
}

export function count(number: number, noun: string): string {
  return `${number} ${noun}${number === 1 ? "" : "s"}`;
}

/** "2 with the best gains, 1 with the first", without those of which there are none. */
export function sharesText(...shares: readonly (readonly [amount: number, what: string])[]): string {
  return shares.flatMap(([amount, what]) => (amount > 0 ? [`${amount} ${what}`] : [])).join(", ");
}

/** More runs of flight numbers than this are counted instead of listed. */
const LISTED = 5;

/** Ascending flight numbers as runs: `["3", "7, 8", "10–15"]`. */
function runsOf(numbers: readonly number[]): string[] {
  const runs: [from: number, to: number][] = [];
  for (const number of numbers) {
    const last = runs.at(-1);
    if (last !== undefined && number === last[1] + 1) last[1] = number;
    else runs.push([number, number]);
  }
  return runs.map(([from, to]) => (from === to ? `${from}` : `${from}${to - from > 1 ? "–" : ", "}${to}`));
}

/** `1–3, 7`, or `153, from 42 to 498`. */
export function flightNumbers(numbers: readonly number[]): string {
  const runs = runsOf(numbers);
  return runs.length > LISTED ? `${numbers.length}, from ${numbers[0]} to ${numbers.at(-1)}` : runs.join(", ");
}

/** `flight 3`, `flights 1–3, 7`, or `153 flights from 42 to 498`. */
export function flightsText(numbers: readonly number[]): string {
  const runs = runsOf(numbers);
  if (runs.length > LISTED) return `${numbers.length} flights from ${numbers[0]} to ${numbers.at(-1)}`;
  return `flight${numbers.length === 1 ? "" : "s"} ${runs.join(", ")}`;
}

/** A large count in groups of three digits, separated by thin spaces. */
export function grouped(number: number): string {
  return String(number).replace(/\B(?=(\d{3})+$)/g, "\u2009");
}

const SIZES = ["kB", "MB", "GB", "TB"] as const;

/** `1.4 GB`: a size in decimal units. */
export function bytesText(bytes: number): string {
  const power = Math.min(SIZES.length, Math.max(1, Math.floor(Math.log10(Math.max(bytes, 1)) / 3)));
  const value = bytes / 1000 ** power;
  return `${value.toFixed(value < 10 ? 1 : 0)} ${SIZES[power - 1]}`;
}

/** Strict parsing of typed numbers, because they are flown. */

export type Reading = { value: number; reason?: undefined } | { value?: undefined; reason: string };

const PLAIN = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

/** Parse `text`, or return the reason why it is not a number, or not a whole one. No commas or spaces. */
export function readNumber(text: string, isWhole = false): Reading {
  const trimmed = text.trim().replace(/^−/, "-");
  if (trimmed === "") return { reason: "Enter a number." };
  const pointed = trimmed.replace(",", ".");
  if (isWhole && PLAIN.test(pointed) && pointed !== trimmed)
    return { reason: "Enter a whole number, without a comma." };
  if (isWhole && PLAIN.test(trimmed) && !Number.isInteger(Number(trimmed))) return { reason: "Enter a whole number." };
  if (PLAIN.test(pointed) && pointed !== trimmed) return { reason: `Use a decimal point, not a comma: ${pointed}.` };
  const value = Number(trimmed);
  if (!PLAIN.test(trimmed) || !Number.isFinite(value)) {
    const example = isWhole ? "a whole number such as 400" : "a decimal number such as 400 or 12.5";
    return { reason: `“${trimmed}” is not a number. Enter ${example}.` };
  }
  return { value: value === 0 ? 0 : value };
}

/** A number as input text, without an exponent where twenty decimals hold it exactly. */
export function typed(value: number): string {
  const text = String(value);
  if (!text.includes("e")) return text;
  const decimal = value.toFixed(20).replace(/\.?0+$/, "");
  return Number(decimal) === value ? decimal : text;
}

/** A computed gain as input text, to six significant digits. */
export function typedGain(value: number): string {
  return typed(Number.isInteger(value) ? value : Number(value.toPrecision(6)));
}
