import { IconOctagonFilled } from "@tabler/icons-react";
import { Link } from "react-router";
import type { FlyingCampaign, useAbort } from "../live/flights";
import { useIsCurrent, useLiveFlight } from "../live/store";
import { readingOf } from "../live/telemetry";
import { withUnit } from "../ui/format";
import classes from "./Frame.module.css";

/** Live readings of one flight and its abort button, which acts without confirmation. */
export function FlyingBar({ flying, abort }: { flying: FlyingCampaign; abort: ReturnType<typeof useAbort> }) {
  const live = useLiveFlight(flying.trialId);
  const isCurrent = useIsCurrent(live);
  const asked = abort.asked.has(flying.trialId);
  const time = live?.timeS.at(-1);
  const reading = readingOf(live?.channel ?? "");
  return (
    <section className={classes["flight"]} aria-label={`Flying: ${flying.name}`}>
      <span className={classes["flightName"]} title={flying.name}>
        {flying.name} · flight {flying.trialNumber}
      </span>
      {isCurrent && <span className={classes["pulse"]} aria-hidden />}
      <Link
        to={`/fly/${flying.trialId}`}
        className={`${classes["readings"]} numbers`}
        data-stale={!isCurrent || undefined}
        title="Open the fly screen"
      >
        {time === undefined ? (
          <span>{live?.phase === "staging" ? "setting gains" : "flying"}</span>
        ) : (
          <>
            <span className={classes["big"]}>{withUnit(live?.measured.at(-1), reading.unit, reading.digits)}</span>
            <span>{withUnit(time, "s", 1)}</span>
            {!isCurrent && <span>last known</span>}
          </>
        )}
      </Link>
      <button type="button" className={classes["abort"]} onClick={() => abort.press([flying.trialId])}>
        <IconOctagonFilled size={20} aria-hidden />
        {asked ? "ABORTING" : "ABORT"}
        {!asked && <kbd>Space</kbd>}
      </button>
    </section>
  );
}
