/** A random key for one request. `crypto.randomUUID` is missing on plain http, where a tablet in the field is. */
export function randomKey(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
