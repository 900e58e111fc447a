import { Anchor, Box, Button, Text, Title } from "@mantine/core";
import { useState } from "react";
import { Link } from "react-router";
import { type Job, type JobLogLine, useCancelJob, useJobLog, useRetryJob } from "../../api/jobs";
import { Aside } from "../../ui/Aside";
import { StateBadge } from "../../ui/Badges";
import { count, utcTime } from "../../ui/format";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import row from "../../ui/RowCard.module.css";
import { Time } from "../../ui/Time";
import classes from "./JobCard.module.css";
import { between, isUnderWay, jobLink, jobStateLabel, jobTitle, progressText } from "./jobs";

/** A job: title, progress, failure and actions. */
export function JobCard({ job, titles }: { job: Job; titles: ReadonlyMap<string, string> }) {
  const cancel = useCancelJob();
  const retry = useRetryJob();
  const title = jobTitle(job, titles);
  const link = jobLink(job);
  return (
    <li className={`${row["card"]} ${classes["job"]}`} data-state={job.state}>
      <div className={`${row["what"]} ${classes["what"]}`}>
        <Title order={3} fz="body">
          {link === null ? (
            title
          ) : (
            <Anchor component={Link} to={link} className={classes["link"]}>
              {title}
            </Anchor>
          )}
        </Title>
        <p className={`${classes["facts"]} numbers`}>
          <StateBadge words={jobStateLabel(job.state)} />
          <span>Job {job.id}</span>
          <span>
            requested <Time at={job.created_at} />
          </span>
          {job.finished_at !== null && job.started_at !== null && (
            <span>took {between(job.started_at, job.finished_at)}</span>
          )}
          {job.attempts > 1 && <span>{count(job.attempts, "attempt")}</span>}
        </p>
        {isUnderWay(job) && <JobProgress job={job} title={`Progress of job ${job.id}: ${title}`} />}
        {job.problem !== null && (
          <Aside tone={job.state === "failed" ? "bad" : undefined} fz="body">
            <strong>{job.problem.title}</strong>
            {job.problem.detail && <p>{job.problem.detail}</p>}
            {job.problem.hint && <Text c="dimmed">{job.problem.hint}</Text>}
          </Aside>
        )}
        <ErrorNotice error={cancel.error ?? retry.error} />
        <JobLog job={job} />
      </div>
      <div className={classes["actions"]}>
        {job.actions.includes("cancel") && (
          <Button
            variant="default"
            aria-label={`Cancel job ${job.id}`}
            loading={cancel.isPending}
            onClick={() => cancel.mutate(job.id)}
          >
            Cancel
          </Button>
        )}
        {job.actions.includes("retry") && (
          <Button
            variant="default"
            aria-label={`Retry job ${job.id}`}
            loading={retry.isPending}
            onClick={() => retry.mutate(job.id)}
          >
            Retry
          </Button>
        )}
      </div>
    </li>
  );
}

/** Progress of a queued or running job. */
export function JobProgress({ job, title }: { job: Job; title: string }) {
  return (
    <Box miw={0}>
      <progress
        className={classes["bar"]}
        aria-label={title}
        aria-valuetext={progressText(job)}
        value={Math.floor(100 * (job.done_share ?? 0))}
        max={100}
      />
      <Note mt={4} fz="small" style={{ overflowWrap: "anywhere" }} className="numbers">
        {progressText(job)}
      </Note>
    </Box>
  );
}

/** The worker's log of a job, loaded when it is opened. */
function JobLog({ job }: { job: Job }) {
  const [open, setOpen] = useState(false);
  const { data: log, error } = useJobLog(job.id, open);
  return (
    <details onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary>Log of job {job.id}</summary>
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
