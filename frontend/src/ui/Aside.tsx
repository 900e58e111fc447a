import { Box, type BoxProps } from "@mantine/core";
import type { ComponentProps } from "react";
import classes from "./Aside.module.css";

interface Props extends BoxProps, Omit<ComponentProps<"div">, keyof BoxProps> {
  tone?: "good" | "warn" | "bad";
}

/** A remark with a coloured edge. */
export function Aside({ tone, className = "", ...props }: Props) {
  return <Box className={`${classes["aside"]} ${className}`} data-tone={tone} {...props} />;
}

/** The tone of a statistical verdict. */
export function toneOf(verdict: string | null | undefined): "good" | "bad" | undefined {
  return verdict === "better" ? "good" : verdict === "worse" ? "bad" : undefined;
}
