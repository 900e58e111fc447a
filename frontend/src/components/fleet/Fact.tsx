interface Props {
  title: string;
  value: string;
  bad?: boolean;
  stale?: boolean;
}

/** One reading with its name; grey is what is no longer so. */
export function Fact({ title, value, bad = false, stale = false }: Props) {
  return (
    <div data-bad={bad || undefined} data-stale={stale || undefined}>
      <dt>{title}</dt>
      <dd>{value}</dd>
    </div>
  );
}
