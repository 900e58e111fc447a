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

/** One reading with its name; stale readings are grey. */
export function LabelledValue({ title, value, topic, bad = false, stale = false }: Props) {
  return (
    <div data-bad={bad || undefined} data-stale={stale || undefined}>
      <dt>
        {title} {topic && <HelpTip topic={topic} />}
      </dt>
      <dd>{value}</dd>
    </div>
  );
}
