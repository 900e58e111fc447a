import { IconEye } from "@tabler/icons-react";
import classes from "./ReadOnlyNotice.module.css";

/** That this browser may only watch, and what would change that. Nothing where it may act. */
export function ReadOnlyNotice({ why }: { why: string | null }) {
  if (why === null) return null;
  return (
    <p className={classes["watch"]} role="status">
      <IconEye size={20} aria-hidden />
      <span>{said(why)}</span>
    </p>
  );
}

/** What stands between backticks is typed as it is. */
function said(why: string) {
  return why.split("`").map((part, index) => (index % 2 === 1 ? <code key={part}>{part}</code> : part));
}
