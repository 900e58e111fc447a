import { Text } from "@mantine/core";
import { IconAlertTriangle, IconEye, IconLockOpen } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { localProblem, otherProblems, problemOf } from "../api/problems";
import { asSentence, stopped } from "./format";
import classes from "./Notices.module.css";

interface Props {
  /** An error of a request, or its problem. */
  error: unknown;
  /** Fields whose reasons are shown at their inputs. */
  shown?: readonly string[];
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

/** What happened, what it means, what to do. Renders nothing without an error. */
export function ErrorNotice({ error, shown = [] }: Props) {
  const problem = problemOf(error);
  if (problem === null) return null;
  const { title, detail, hint } = problem;
  const others = otherProblems(problem, shown).filter(({ field }) => field !== "version");
  return (
    <div className={classes["notice"]} role="alert">
      <IconAlertTriangle size={20} color="var(--bad)" aria-hidden />
      <div>
        <strong>{title}</strong>
        {detail && detail !== title && <p>{detail}</p>}
        {others.length > 0 && (
          <ul>
            {others.map(({ field, reason }) => (
              <li key={`${field} ${reason}`}>
                {!isSentence(reason) && (LABELS[field] ?? <code>{field}</code>)} {stopped(reason)}
              </li>
            ))}
          </ul>
        )}
        {hint && (
          <Text inherit c="dimmed">
            {withCode(hint)}
          </Text>
        )}
      </div>
    </div>
  );
}

/** Why something failed earlier, as the server has stored it. Renders nothing without a reason. */
export function FailureNotice({ reason }: { reason: string }) {
  return <ErrorNotice error={reason === "" ? null : localProblem(asSentence(reason))} />;
}

interface AccessProps {
  Icon: typeof IconEye;
  children: ReactNode;
}

function AccessNotice({ Icon, children }: AccessProps) {
  return (
    <p className={classes["access"]} role="status">
      <Icon size={20} aria-hidden />
      <span>{children}</span>
    </p>
  );
}

/** Explains why this browser has read-only access; renders nothing without a reason. */
export function ReadOnlyNotice({ why }: { why: string | null }) {
  return why && <AccessNotice Icon={IconEye}>{withCode(why)}</AccessNotice>;
}

/** Confirms what this browser may do now; renders nothing without it. */
export function UnlockedNotice({ what }: { what: string | null }) {
  return what && <AccessNotice Icon={IconLockOpen}>{what}</AccessNotice>;
}

/** Text between backticks is code. */
export function withCode(why: string) {
  return why.split("`").map((part, index) => (index % 2 === 1 ? <code key={part}>{part}</code> : part));
}
