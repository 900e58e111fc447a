/** Order and choice of the columns and rows of the table of flights. */

/** The value by which a column sorts; null sorts last. */
export type Sortable = number | string | null;

export interface Order {
  column: string;
  descending: boolean;
}

/** The order after a click on a column's title: rising, falling, then by flight number again. */
export function nextOrder(order: Order | null, column: string): Order | null {
  if (order?.column !== column) return { column, descending: false };
  return order.descending ? null : { column, descending: true };
}

function compared(one: Sortable, other: Sortable): number {
  if (typeof one === "number" && typeof other === "number") return one - other;
  return String(one).localeCompare(String(other));
}

/** The rows by a column's value, equal ones in their given order, those without a value last. */
export function sortedBy<T>(rows: readonly T[], value: (row: T) => Sortable, descending: boolean): readonly T[] {
  const present = rows.filter((row) => value(row) !== null);
  const sign = descending ? -1 : 1;
  present.sort((one, other) => sign * compared(value(one), value(other)));
  return [...present, ...rows.filter((row) => value(row) === null)];
}

/** The items with one added or removed. */
export function toggled<T>(items: readonly T[], item: T): T[] {
  return items.includes(item) ? items.filter((one) => one !== item) : [...items, item];
}
