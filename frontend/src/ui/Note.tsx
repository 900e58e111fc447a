import { Text, type TextProps } from "@mantine/core";
import type { ComponentProps } from "react";

/** A paragraph of secondary text. */
export function Note(props: TextProps & Omit<ComponentProps<"p">, keyof TextProps>) {
  return <Text c="dimmed" lh={1.45} {...props} />;
}
