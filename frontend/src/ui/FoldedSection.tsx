import { Accordion } from "@mantine/core";
import { type ReactNode, useState } from "react";

/** The library makes ids of it, so it must be one word. */
const SECTION = "section";

interface Props {
  title: string;
  /** Whether it must be open, because it contains a refused field. */
  forcedOpen: boolean;
  children: ReactNode;
}

/** The part of a form that has defaults, collapsed at first. */
export function FoldedSection({ title, forcedOpen, children }: Props) {
  const [opened, setOpened] = useState<string | null>(null);
  return (
    <Accordion variant="contained" chevronPosition="left" value={forcedOpen ? SECTION : opened} onChange={setOpened}>
      <Accordion.Item value={SECTION}>
        <Accordion.Control mih={56}>{title}</Accordion.Control>
        <Accordion.Panel>{children}</Accordion.Panel>
      </Accordion.Item>
    </Accordion>
  );
}
