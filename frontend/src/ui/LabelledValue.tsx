import type { ReactNode } from "react";
import type { Topic } from "./explanations";
import { HelpTip } from "./HelpTip";
import classes from "./LabelledValue.module.css";

interface Props {
  title: ReactNode;
  value: ReactNode;
  topic?: Topic | undefined;
  size?: "huge" | "large";
  bad?: boolean;
  stale?: boolean;
}

/** One reading with its name, as large as its list has them; grey if it is stale. */
export function LabelledValue({ title, value, topic, size, bad, stale }: Props) {
  return (
    <div
      className={classes["value"]}
      data-size={size}
      data-tone={bad ? "bad" : undefined}
      data-stale={stale || undefined}
    >
      <dt>
        {title} {topic && <HelpTip topic={topic} />}
      </dt>
      <dd>{value}</dd>
    </div>
  );
}
