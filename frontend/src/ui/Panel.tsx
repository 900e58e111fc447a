import type { ReactNode } from "react";
import classes from "./Panel.module.css";

interface Props {
  title: ReactNode;
  tools?: ReactNode;
  children: ReactNode;
  className?: string | undefined;
}

export function Panel({ title, tools, children, className = "" }: Props) {
  return (
    <section className={`${classes["panel"]} ${className}`}>
      <div className={classes["head"]}>
        <h2 className={classes["title"]}>{title}</h2>
        {tools && <div className={classes["tools"]}>{tools}</div>}
      </div>
      {children}
    </section>
  );
}
