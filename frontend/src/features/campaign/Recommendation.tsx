import { IconFlagCheck, IconHome, IconRepeat, IconStairsUp } from "@tabler/icons-react";
import classes from "./NextFlight.module.css";
import { type Advised, RECOMMENDED } from "./proposal";

const ICONS = { step: IconStairsUp, repeat: IconRepeat, baseline: IconHome, stop: IconFlagCheck } as const;

/** The recommended action, and its reason. */
export function Recommendation({ advice }: { advice: Advised }) {
  const Icon = ICONS[advice.kind];
  return (
    <div className={classes["advice"]} data-kind={advice.kind}>
      <Icon size={22} className={classes["adviceIcon"]} aria-hidden />
      <p>
        <strong>Recommended: {RECOMMENDED[advice.kind].toLowerCase()}</strong>
        {advice.why && <span>{advice.why}</span>}
      </p>
    </div>
  );
}
