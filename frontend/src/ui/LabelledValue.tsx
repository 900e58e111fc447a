import { Box } from "@mantine/core";
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

/** One reading with its name, as large as its list makes them; stale readings are grey. */
export function LabelledValue({ title, value, topic, bad = false, stale = false }: Props) {
  const color = bad ? "var(--bad)" : "var(--ink)";
  return (
    <div>
      <dt>
        {title} {topic && <HelpTip topic={topic} />}
      </dt>
      <Box component="dd" c={stale ? "dimmed" : color} fw={stale ? 550 : undefined}>
        {value}
      </Box>
    </div>
  );
}
