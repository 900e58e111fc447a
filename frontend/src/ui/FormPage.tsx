import { Skeleton } from "@mantine/core";
import type { ReactNode } from "react";
import { ErrorNotice } from "./ErrorNotice";
import classes from "./Form.module.css";

interface Props {
  title: string;
  error: unknown;
  isPending: boolean;
  children: ReactNode;
}

/** A page with one form, while what the form needs is loaded, and after. */
export function FormPage({ title, error, isPending, children }: Props) {
  return (
    <div className={classes["page"]}>
      <h1 className={classes["title"]}>{title}</h1>
      {children}
      <ErrorNotice error={error} />
      {isPending && <Skeleton height={420} radius="md" aria-busy="true" />}
    </div>
  );
}
