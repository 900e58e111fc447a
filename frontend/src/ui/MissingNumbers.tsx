/** The fields without a valid number, which block the form. */
export function MissingNumbers({ fields }: { fields: readonly string[] }) {
  return fields.length === 0 ? null : <p role="status">Enter a number for {fields.join(", ")}.</p>;
}
