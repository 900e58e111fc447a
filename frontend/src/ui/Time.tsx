import { localTime, NOTHING, utcTime } from "./format";

/** Local time, with UTC on hover. */
export function Time({ at, seconds = false }: { at: string | null | undefined; seconds?: boolean }) {
  if (!at) return <span>{NOTHING}</span>;
  return (
    <time dateTime={at} title={utcTime(at)}>
      {localTime(at, { seconds })}
    </time>
  );
}
