import { IconAlertTriangleFilled, IconCircle, IconCircleCheckFilled, IconCircleXFilled } from "@tabler/icons-react";
import type { Readiness, ReadinessStep } from "../../live/readiness";
import { Aside } from "../../ui/Aside";
import { withCode } from "../../ui/Notices";
import classes from "./ReadinessStepper.module.css";

/** Every step, in order. */
const TITLES: Record<ReadinessStep, string> = {
  control: "Control",
  staged: "Staged",
  held: "Hold",
  "in flight": "In flight",
  landed: "Landed",
  reviewed: "Reviewed",
};
const STEPS = Object.keys(TITLES) as ReadinessStep[];

const STANDINGS = {
  done: { Icon: IconCircleCheckFilled, word: "done", tone: "good" },
  lost: { Icon: IconCircleXFilled, word: "lost", tone: "bad" },
  open: { Icon: IconCircle, word: "not reached", tone: "quiet" },
} as const;

function standingOf(step: ReadinessStep, { steps, lost }: Readiness): keyof typeof STANDINGS {
  if (steps.includes(step)) return "done";
  return lost.includes(step) ? "lost" : "open";
}

/** Steps of an operator, which a simulation does not need. */
const OPERATORS: ReadonlySet<ReadinessStep> = new Set(["control", "held"]);

interface Props {
  readiness: Readiness;
  /** Whether an operator must be in control, and hold the button to fly. */
  needsOperator: boolean;
}

/** How far a flight has come, and what was taken back. */
export function ReadinessStepper({ readiness, needsOperator }: Props) {
  return (
    <ol className={classes["stepper"]} aria-label="Readiness">
      {STEPS.filter((step) => needsOperator || !OPERATORS.has(step)).map((step) => {
        const standing = standingOf(step, readiness);
        const { Icon, word, tone } = STANDINGS[standing];
        return (
          <li key={step} data-standing={standing} data-tone={tone}>
            <Icon size={20} aria-hidden />
            {TITLES[step]}
            <span className="visually-hidden">: {word}</span>
          </li>
        );
      })}
    </ol>
  );
}

/** Why steps were taken back, and the way on. */
export function ReadinessLosses({ losses }: Pick<Readiness, "losses">) {
  return losses.map(({ kind, what, way_on }) => (
    <Aside key={kind} tone="bad" fz="small" display="flex" style={{ gap: 8 }} role="alert">
      <IconAlertTriangleFilled size={20} color="var(--bad)" aria-hidden />
      <span>
        <strong>{what}</strong> {withCode(way_on)}
      </span>
    </Aside>
  ));
}
