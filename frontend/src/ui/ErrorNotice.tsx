import { IconAlertTriangle } from "@tabler/icons-react";
import { otherProblems, problemOf } from "../api/problems";
import classes from "./ErrorNotice.module.css";

interface Props {
  error: unknown;
  /** Fields whose reasons stand at their inputs already. */
  shown?: readonly string[];
}

/** What went wrong, what it means, what to do. Nothing when nothing did. */
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
