import type { ReactNode } from "react";
import type { Topic } from "./explanations";
import { HelpTip } from "./HelpTip";

interface Props {
  title: ReactNode;
  value: ReactNode;
  topic?: Topic;
  bad?: boolean;
  stale?: boolean;
}

/** One reading with its name, as large as its list has them. */
export function LabelledValue({ title, value, topic, bad, stale }: Props) {
  return (
    <div data-bad={bad || undefined} data-stale={stale || undefined}>
      <dt>
        {title} {topic && <HelpTip topic={topic} />}
      </dt>
      <dd>{value}</dd>
    </div>
  );
}
