import { Text } from "@mantine/core";
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
  const color = bad ? "var(--bad)" : "var(--ink)";
  return (
    <div>
      <Text component="dt" c="dimmed" fz="small">
        {title} {topic && <HelpTip topic={topic} />}
      </Text>
      <Text component="dd" c={stale ? "dimmed" : color} fw={stale ? 550 : 650} fz="strong">
        {value}
      </Text>
    </div>
  );
}
