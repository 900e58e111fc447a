import { Anchor, Box, Button, Text } from "@mantine/core";
import { type ReactNode, useState } from "react";
import { Link } from "react-router";
import { type Job, type LogLine, useCancelJob, useJobLog, useRetryJob } from "../../api/jobs";
import { Aside } from "../../ui/Aside";
import { StateBadge } from "../../ui/Badges";
import { count, utcTime } from "../../ui/format";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import row from "../../ui/RowCard.module.css";
import { ScrollTable } from "../../ui/ScrollTable";
import { Time } from "../../ui/Time";
import classes from "./Jobs.module.css";
import { between, isUnderWay, jobLink, jobStateLabel, jobTitle, progressText } from "./jobs";

const COLUMNS = ["Job", "Campaign", "State", "Requested", "Duration", "Actions"] as const;

interface JobTableProps {
  label: string;
  jobs: readonly Job[];
  /** Titles of the reproductions, by name. */
  titles: ReadonlyMap<string, string>;
}

export function JobTable({ label, jobs, titles }: JobTableProps) {
  return (
    <ScrollTable label={label} className={classes["jobs"]}>
      <thead>
        <tr>
          {COLUMNS.map((column) => (
            <th key={column} scope="col">
              {column === "Actions" ? <span className="visually-hidden">{column}</span> : column}
            </th>
          ))}
        </tr>
      </thead>
      {jobs.map((job) => (
        <JobRows key={job.id} job={job} titles={titles} />
      ))}
    </ScrollTable>
  );
}

/** Rows of a job: what it is, its campaign, state and times; below them its progress, failure and log, if any. */
function JobRows({ job, titles }: { job: Job; titles: ReadonlyMap<string, string> }) {
  const cancel = useCancelJob();
  const retry = useRetryJob();
  const [isLogOpen, setLogOpen] = useState(false);
  const title = jobTitle(job, titles);
  const link = jobLink(job);
  const refusal = cancel.error ?? retry.error;
  const hasMore = isLogOpen || isUnderWay(job) || job.problem !== null || refusal !== null;
  return (
    <tbody data-state={job.state}>
      <tr>
        <th scope="row">
          {link === null ? title : <Linked to={link}>{title}</Linked>} <small className="numbers">Job {job.id}</small>
        </th>
        <td>
          {job.campaign_id !== null && (
            <Linked to={`/campaigns/${job.campaign_id}`}>{job.campaign_name ?? `Campaign ${job.campaign_id}`}</Linked>
          )}
        </td>
        <td>
          <StateBadge words={jobStateLabel(job.state)} />
          {job.attempts > 1 && <small className="numbers">{count(job.attempts, "attempt")}</small>}
        </td>
        <td className="numbers">
          <Time at={job.created_at} />
        </td>
        <td className="numbers">
          {job.finished_at !== null && job.started_at !== null && between(job.started_at, job.finished_at)}
        </td>
        <td className={classes["actions"]}>
          {job.started_at !== null && (
            <Button
              variant="subtle"
              aria-label={`Log of job ${job.id}`}
              aria-expanded={isLogOpen}
              onClick={() => setLogOpen(!isLogOpen)}
            >
              Log
            </Button>
          )}
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
        </td>
      </tr>
      {hasMore && (
        <tr>
          <td colSpan={COLUMNS.length}>
            {isUnderWay(job) && <JobProgress job={job} title={`Progress of job ${job.id}: ${title}`} />}
            {job.problem !== null && (
              <Aside tone={job.state === "failed" ? "bad" : undefined} fz="body">
                <strong>{job.problem.title}</strong>
                {job.problem.detail && <p>{job.problem.detail}</p>}
                {job.problem.hint && <Text c="dimmed">{job.problem.hint}</Text>}
              </Aside>
            )}
            <ErrorNotice error={refusal} />
            {isLogOpen && <JobLog job={job} />}
          </td>
        </tr>
      )}
    </tbody>
  );
}

function Linked({ to, children }: { to: string; children: ReactNode }) {
  return (
    <Anchor component={Link} to={to} className={row["link"]}>
      {children}
    </Anchor>
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

/** The worker's log of a job. */
function JobLog({ job }: { job: Job }) {
  const { data: log, error } = useJobLog(job.id);
  return (
    <>
      <ErrorNotice error={error} />
      {log?.lines.length === 0 && (
        <Note fz="small" mb={6}>
          The log was deleted.
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
    </>
  );
}

function Line({ line: { at, level, message, details, exception } }: { line: LogLine }) {
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
