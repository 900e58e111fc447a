/** Long tables: the rows that are shown at first, and more of them on demand. */

export const ROWS = 50;
export const MORE_ROWS = 200;

/** The last `count` rows, with those before them that are to be seen in any case. */
export function lastRows<T>(rows: readonly T[], count: number, kept: (row: T) => boolean): readonly T[] {
  const from = Math.max(0, rows.length - count);
  return from === 0 ? rows : [...rows.slice(0, from).filter(kept), ...rows.slice(from)];
}
