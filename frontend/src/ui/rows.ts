/** Long tables: the number of rows shown at first, and added on demand. */

export const ROWS = 50;
export const MORE_ROWS = 200;

/** The last `count` rows, and earlier rows for which `kept` is true. */
export function lastRows<T>(rows: readonly T[], count: number, kept: (row: T) => boolean): readonly T[] {
  const from = Math.max(0, rows.length - count);
  return from === 0 ? rows : [...rows.slice(0, from).filter(kept), ...rows.slice(from)];
}
