/** Numbers that a person types: read strictly, because what is read is flown. */

export type Reading = { value: number; reason?: undefined } | { value?: undefined; reason: string };

const PLAIN = /^[+-]?(\d+\.?\d*|\.\d+)$/;

/** The number that `text` is, or why it is none. Only plain decimal numbers are: no exponents, commas or gaps. */
export function readNumber(text: string): Reading {
  const trimmed = text.trim().replace(/^−/, "-");
  if (trimmed === "") return { reason: "A number is missing." };
  if (trimmed.includes(",")) return { reason: "Write a point, not a comma: 1.5." };
  const value = Number(trimmed);
  if (!PLAIN.test(trimmed) || !Number.isFinite(value)) {
    return { reason: `“${trimmed}” is not a plain number like 400 or 12.5.` };
  }
  return { value: value === 0 ? 0 : value };
}

/** A number as it is typed: never with an exponent. */
export function typed(value: number): string {
  const text = String(value);
  return text.includes("e") ? value.toFixed(20).replace(/\.?0+$/, "") : text;
}

/** A computed gain as it is typed: in six digits, which is more than any flight can tell. */
export function typedGain(value: number): string {
  return typed(Number.isInteger(value) ? value : Number(value.toPrecision(6)));
}
