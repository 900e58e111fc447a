import { localTime, NOTHING, utcTime } from "./format";

/** Local time, with UTC on hover. */
export function Time({ at }: { at: string | null | undefined }) {
  if (!at) return <span>{NOTHING}</span>;
  return (
    <time dateTime={at} title={utcTime(at)}>
      {localTime(at)}
    </time>
  );
}
