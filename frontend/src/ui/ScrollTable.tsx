import type { ComponentProps } from "react";
import classes from "./ScrollTable.module.css";

export interface TableFrame extends ComponentProps<"section"> {
  label: string;
  /** Of the table. */
  className?: string;
  /** Whether a long table scrolls under its head instead of making the page longer. */
  framed?: boolean;
  /** In px, in place of what its rows need. */
  height?: number;
}

/** Table in a region that scrolls sideways where the screen is too narrow. */
export function ScrollTable({ label, className = "", framed, height, children, ...region }: TableFrame) {
  const isFramed = framed || height !== undefined;
  return (
    <section
      {...region}
      className={`${classes["scroll"]} ${isFramed ? classes["framed"] : ""} sideways`}
      style={{ height, maxHeight: height }}
      aria-label={label}
      // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
      tabIndex={0}
    >
      <table className={`${classes["table"]} ${className}`}>{children}</table>
    </section>
  );
}
