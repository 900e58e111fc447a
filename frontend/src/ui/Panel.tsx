import { Group, Title } from "@mantine/core";
import type { ReactNode } from "react";
import classes from "./Panel.module.css";

interface Props {
  title: ReactNode;
  tools?: ReactNode;
  children: ReactNode;
  className?: string;
}

export function Panel({ title, tools, children, className = "" }: Props) {
  return (
    <section className={`${classes["panel"]} ${className}`}>
      <Group justify="space-between" gap="4px 10px" mih={48} mb={8}>
        <Title order={2} fz="strong" lh="inherit" lts="-0.005em">
          {title}
        </Title>
        {tools && (
          <Group gap={6} ml="auto" wrap="nowrap">
            {tools}
          </Group>
        )}
      </Group>
      {children}
    </section>
  );
}
