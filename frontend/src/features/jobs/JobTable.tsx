import { Anchor, Box, Button, Text } from "@mantine/core";
import { type ReactNode, useState } from "react";
import { Link } from "wouter";
import { type Job, useCancelJob, useJobLog, useRetryJob } from "../../api/jobs";
import { Aside } from "../../ui/Aside";
import { StateBadge } from "../../ui/Badges";
import { count, utcTime } from "../../ui/format";
import { type Column, ListTable } from "../../ui/ListTable";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Time } from "../../ui/Time";
import { toggled } from "../../ui/toggled";
import classes from "./Jobs.module.css";
import { between, isUnderWay, jobTitle, progressText, STATE_LABELS } from "./jobs";

interface JobTableProps {
  label: string;
  jobs: readonly Job[];
  /** Titles of the reproductions, by name. */
  titles: ReadonlyMap<string, string>;
}

/** Jobs: what each is, its campaign, state and times; below them its progress, failure and log, if any. */
export function JobTable({ label, jobs, titles }: JobTableProps) {
  const acts = [
    { name: "cancel", word: "Cancel", ...useCancelJob() },
    { name: "retry", word: "Retry", ...useRetryJob() },
  ];
  const [opened, setOpened] = useState<readonly number[]>([]);
  const columns: Column<Job>[] = [
    {
      title: "Job",
      isHeading: true,
      cell: (job) => (
        <>
          {job.kind === "reproduction" ? (
            <Linked to={`/reproductions#${job.name}`}>{jobTitle(job, titles)}</Linked>
          ) : (
            jobTitle(job, titles)
          )}{" "}
          <Note span fz="small" fw={400}>
            Job {job.id}
          </Note>
        </>
      ),
    },
    {
      title: "Campaign",
      isText: true,
      cell: ({ campaign_id: id, campaign_name: name }) =>
        id !== null && <Linked to={`/campaigns/${id}`}>{name ?? `Campaign ${id}`}</Linked>,
    },
    {
      title: "State",
      isText: true,
      cell: ({ state, attempts }) => (
        <>
          <StateBadge words={STATE_LABELS[state]} />
          {attempts > 1 && <small>{count(attempts, "attempt")}</small>}
        </>
      ),
    },
    { title: "Requested", isText: true, cell: ({ created_at }) => <Time at={created_at} /> },
    {
      title: "Duration",
      isText: true,
      cell: ({ started_at, finished_at }) => started_at && finished_at && between(started_at, finished_at),
    },
    {
      title: "Actions",
      hidesTitle: true,
      className: classes["actions"],
      cell: ({ id, started_at, actions }) => (
        <>
          {started_at !== null && (
            <Button
              variant="subtle"
              aria-label={`Log of job ${id}`}
              aria-expanded={opened.includes(id)}
              onClick={() => setOpened(toggled(opened, id))}
            >
              Log
            </Button>
          )}
          {acts
            .filter(({ name }) => actions.includes(name))
            .map(({ name, word, isPending, variables, mutate }) => (
              <Button
                key={name}
                variant="default"
                aria-label={`${word} job ${id}`}
                loading={isPending && variables === id}
                onClick={() => mutate(id)}
              >
                {word}
              </Button>
            ))}
        </>
      ),
    },
  ];
  return (
    <ListTable
      label={label}
      className={classes["jobs"]}
      columns={columns}
      rows={jobs}
      keyOf={({ id }) => String(id)}
      marks={({ state }) => ({ "data-state": state })}
      below={(job) => {
        const refusal = acts.find(({ variables, error }) => variables === job.id && error !== null)?.error;
        const isLogOpen = opened.includes(job.id);
        if (!isLogOpen && !isUnderWay(job) && job.problem === null && !refusal) return null;
        return (
          <>
            {isUnderWay(job) && <JobProgress job={job} title={`Progress of job ${job.id}: ${jobTitle(job, titles)}`} />}
            {job.problem !== null && (
              <Aside tone={job.state === "failed" ? "bad" : undefined} fz="body">
                <strong>{job.problem.title}</strong>
                {job.problem.detail && <p>{job.problem.detail}</p>}
                {job.problem.hint && <Text c="dimmed">{job.problem.hint}</Text>}
              </Aside>
            )}
            <ErrorNotice error={refusal} />
            {isLogOpen && <JobLog job={job} />}
          </>
        );
      }}
    />
  );
}

function Linked({ to, children }: { to: string; children: ReactNode }) {
  return (
    <Anchor component={Link} to={to} display="inline-block" py={4}>
      {children}
    </Anchor>
  );
}

/** Progress of a queued or running job. */
export function JobProgress({ job, title }: { job: Job; title: string }) {
  return (
    <Box miw={0}>
      <progress
        style={{ width: "100%", accentColor: "var(--best)" }}
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
  if (log === undefined) return <ErrorNotice error={error} />;
  const { lines, total } = log;
  return (
    <>
      {total === 0 && <Note fz="small">The log was deleted.</Note>}
      {total > lines.length && (
        <Note fz="small" mb={6}>
          The last {lines.length} of {total} lines:
        </Note>
      )}
      <ol className={classes["lines"]}>
        {lines.map(({ at, level, message, details, exception }) => {
          const more = Object.entries(details).map(([name, value]) => `${name} ${value}`);
          return (
            <li key={`${at} ${message}`} data-level={level}>
              <time dateTime={at} title={utcTime(at)}>
                {new Date(at).toLocaleTimeString()}
              </time>{" "}
              {level !== "info" && <strong>{level}: </strong>}
              {message}
              {more.length > 0 && (
                <Note span inherit>
                  {" "}
                  ({more.join(", ")})
                </Note>
              )}
              {exception !== "" && <pre>{exception}</pre>}
            </li>
          );
        })}
      </ol>
    </>
  );
}
