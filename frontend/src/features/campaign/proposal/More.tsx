import { Stack } from "@mantine/core";
import type { ComponentProps } from "react";
import classes from "./Proposal.module.css";

/** Details of a card, collapsed at first. */
export function More({ summary, children, ...props }: ComponentProps<"details"> & { summary: string }) {
  return (
    <details className={classes["more"]} {...props}>
      <summary>{summary}</summary>
      <Stack gap={14} pb={12} fz="small" lh={1.45}>
        {children}
      </Stack>
    </details>
  );
}
