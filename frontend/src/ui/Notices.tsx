import { IconAlertTriangle, IconEye, IconLockOpen } from "@tabler/icons-react";
import { type FieldProblem, formProblem, otherProblems, type Problem, problemOf } from "../api/problems";
import { asSentence, stopped } from "./format";
import classes from "./Notices.module.css";

interface Props {
  /** An error of a request, or its problem. */
  error: unknown;
  /** Fields whose reasons are shown at their inputs. */
  shown?: readonly string[];
}

/** What happened, what it means, what to do. Renders nothing without an error. */
export function ErrorNotice({ error, shown = [] }: Props) {
  const problem = problemOf(error);
  return problem === null ? null : <ProblemNotice problem={problem} shown={shown} />;
}

/** Why something failed earlier, as the server has stored it. Renders nothing without a reason. */
export function FailureNotice({ reason }: { reason: string }) {
  if (reason === "") return null;
  return (
    <ProblemNotice problem={{ status: 0, title: asSentence(reason), detail: "", hint: "", problems: [] }} shown={[]} />
  );
}

/** What the server's names stand for on a page. */
const LABELS: Readonly<Record<string, string>> = {
  altitude_m: "The altitude",
  definition: "The definition",
  file: "The file",
  gains: "The gains",
  name: "The name",
  note: "The note",
  outcome: "The flight",
  safe_gains: "The safe gains",
  time_s: "The record",
};

/** Reasons of the gate are sentences of their own, the others continue the field's name. */
const isSentence = (reason: string): boolean => /^\p{Lu}/u.test(reason);

function Named({ field, reason }: FieldProblem) {
  return (
    <>
      {LABELS[field] ?? <code>{field}</code>} {stopped(reason)}
    </>
  );
}

function ProblemNotice({ problem, shown }: { problem: Problem; shown: readonly string[] }) {
  const others = otherProblems(problem, shown).filter(({ field }) => field !== "version");
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
                {isSentence(reason) ? stopped(reason) : <Named field={field} reason={reason} />}
              </li>
            ))}
          </ul>
        )}
        {problem.hint && <p className={classes["hint"]}>{withCode(problem.hint)}</p>}
      </div>
    </div>
  );
}

interface FormErrorProps {
  error: unknown;
  /** Labels of the form's fields, by the names that the server has for them; each shows its own reason. */
  labels: Readonly<Record<string, string>>;
}

/** A form's refusal: which fields to correct, where all reasons are written at their fields. */
export function FormErrorNotice({ error, labels }: FormErrorProps) {
  return <ErrorNotice error={formProblem(error, labels)} shown={Object.keys(labels)} />;
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

/** Confirms what this browser may do now; renders nothing without it. */
export function UnlockedNotice({ what }: { what: string | null }) {
  if (what === null) return null;
  return (
    <p className={classes["watch"]} role="status">
      <IconLockOpen size={20} aria-hidden />
      <span>{what}</span>
    </p>
  );
}

/** Text between backticks is code. */
export function withCode(why: string) {
  return why.split("`").map((part, index) => (index % 2 === 1 ? <code key={part}>{part}</code> : part));
}
