import type { ReactNode } from "react";
import classes from "./ScrollTable.module.css";

interface Props {
  label: string;
  className?: string | undefined;
  children: ReactNode;
}

/** Table in a region that scrolls sideways where the screen is too narrow. `className` is the table's. */
export function ScrollTable({ label, className = "", children }: Props) {
  return (
    // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
    <section className={`${classes["scroll"]} sideways`} aria-label={label} tabIndex={0}>
      <table className={`${classes["table"]} ${className}`}>{children}</table>
    </section>
  );
}
