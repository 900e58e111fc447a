/** Strict parsing of typed numbers, because they are flown. */

export type Reading = { value: number; reason?: undefined } | { value?: undefined; reason: string };

const PLAIN = /^[+-]?(\d+\.?\d*|\.\d+)$/;

/** Parse `text`, or return the reason why it is not a number. No exponents, commas or spaces. */
export function readNumber(text: string): Reading {
  const trimmed = text.trim().replace(/^−/, "-");
  if (trimmed === "") return { reason: "Enter a number." };
  if (trimmed.includes(",")) return { reason: "Use a decimal point, not a comma: 1.5." };
  const value = Number(trimmed);
  if (!PLAIN.test(trimmed) || !Number.isFinite(value)) {
    return { reason: `“${trimmed}” is not a number. Enter a decimal number such as 400 or 12.5.` };
  }
  return { value: value === 0 ? 0 : value };
}

/** A number as input text, without an exponent. */
export function typed(value: number): string {
  const text = String(value);
  return text.includes("e") ? value.toFixed(20).replace(/\.?0+$/, "") : text;
}

/** A computed gain as input text, to six significant digits. */
export function typedGain(value: number): string {
  return typed(Number.isInteger(value) ? value : Number(value.toPrecision(6)));
}
