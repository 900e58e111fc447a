import type { ReactNode } from "react";
import classes from "./ScrollTable.module.css";

interface Props {
  label: string;
  className?: string | undefined;
  /** Whether a long table scrolls under its head instead of making the page longer. */
  framed?: boolean;
  children: ReactNode;
}

/** Table in a region that scrolls sideways where the screen is too narrow. `className` is the table's. */
export function ScrollTable({ label, className = "", framed = false, children }: Props) {
  const region = `${classes["scroll"]} ${framed ? classes["framed"] : ""} sideways`;
  return (
    // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
    <section className={region} aria-label={label} tabIndex={0}>
      <table className={`${classes["table"]} ${className}`}>{children}</table>
    </section>
  );
}
