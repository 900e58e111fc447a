import { useState } from "react";
import { type Job, type JobLogLine, useJobLog } from "../../api/jobs";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { utcTime } from "../../ui/format";
import { Note } from "../../ui/Note";
import classes from "./JobLog.module.css";

/** The worker's log of a job, loaded when it is opened. */
export function JobLog({ job }: { job: Job }) {
  const [open, setOpen] = useState(false);
  const { data: log, error } = useJobLog(job.id, open);
  return (
    <details className={classes["log"]} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary className={classes["summary"]}>Log of job {job.id}</summary>
      <ErrorNotice error={error} />
      {log?.lines.length === 0 && (
        <Note fz="small" mb={6}>
          {job.started_at === null ? "Not started yet." : "The log was deleted."}
        </Note>
      )}
      {log !== undefined && log.total > log.lines.length && (
        <Note fz="small" mb={6}>
          The last {log.lines.length} of {log.total} lines:
        </Note>
      )}
      <ol className={classes["lines"]}>
        {log?.lines.map((line) => (
          <Line key={`${line.at} ${line.message}`} line={line} />
        ))}
      </ol>
    </details>
  );
}

function Line({ line: { at, level, message, details, exception } }: { line: JobLogLine }) {
  const more = Object.entries(details).map(([name, value]) => `${name} ${value}`);
  return (
    <li data-level={level}>
      <time dateTime={at} title={utcTime(at)} className="numbers">
        {new Date(at).toLocaleTimeString()}
      </time>{" "}
      {level !== "info" && <strong>{level}: </strong>}
      {message}
      {more.length > 0 && <span className={classes["details"]}> ({more.join(", ")})</span>}
      {exception !== "" && <pre className={classes["exception"]}>{exception}</pre>}
    </li>
  );
}
