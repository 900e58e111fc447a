import { IconAlertTriangle, IconEye } from "@tabler/icons-react";
import { otherProblems, problemOf } from "../api/problems";
import classes from "./Notices.module.css";

interface Props {
  error: unknown;
  /** Fields whose reasons are shown at their inputs. */
  shown?: readonly string[];
}

/** What happened, what it means, what to do. Renders nothing without an error. */
export function ErrorNotice({ error, shown = [] }: Props) {
  const problem = problemOf(error);
  if (problem === null) return null;
  const others = otherProblems(problem, shown);
  return (
    <div className={classes["trouble"]} role="alert">
      <IconAlertTriangle size={20} aria-hidden />
      <div>
        <strong>{problem.title}</strong>
        {problem.detail && problem.detail !== problem.title && <p>{problem.detail}</p>}
        {others.length > 0 && (
          <ul>
            {others.map(({ field, reason }) => (
              <li key={`${field} ${reason}`}>
                <code>{field}</code> {reason}
              </li>
            ))}
          </ul>
        )}
        {problem.hint && <p className={classes["hint"]}>{problem.hint}</p>}
      </div>
    </div>
  );
}

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
