import { IconEye } from "@tabler/icons-react";
import classes from "./ReadOnlyNotice.module.css";

/** Explains why this browser has read-only access; renders nothing without a reason. */
export function ReadOnlyNotice({ why }: { why: string | null }) {
  if (why === null) return null;
  return (
    <p className={classes["watch"]} role="status">
      <IconEye size={20} aria-hidden />
      <span>{withCode(why)}</span>
    </p>
  );
}

/** Text between backticks is code. */
function withCode(why: string) {
  return why.split("`").map((part, index) => (index % 2 === 1 ? <code key={part}>{part}</code> : part));
}
