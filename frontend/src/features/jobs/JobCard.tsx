import { Anchor, Button } from "@mantine/core";
import { Link } from "react-router";
import { type Job, useCancelJob, useRetryJob } from "../../api/jobs";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { count } from "../../ui/format";
import row from "../../ui/RowCard.module.css";
import { StateBadge } from "../../ui/StateBadge";
import { Time } from "../../ui/Time";
import classes from "./JobCard.module.css";
import { JobLog } from "./JobLog";
import { JobProgress } from "./JobProgress";
import { between, isUnderWay, jobLink, jobStateLabel, jobTitle } from "./jobs";

/** A job: title, progress, failure and actions. */
export function JobCard({ job, titles }: { job: Job; titles: ReadonlyMap<string, string> }) {
  const cancel = useCancelJob();
  const retry = useRetryJob();
  const title = jobTitle(job, titles);
  const link = jobLink(job);
  return (
    <li className={`${row["card"]} ${classes["job"]}`} data-state={job.state}>
      <div className={`${row["what"]} ${classes["what"]}`}>
        <h3 className={classes["title"]}>
          {link === null ? (
            title
          ) : (
            <Anchor component={Link} to={link} className={classes["link"]}>
              {title}
            </Anchor>
          )}
        </h3>
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
          <div className={classes["trouble"]}>
            <strong>{job.problem.title}</strong>
            {job.problem.detail && <p>{job.problem.detail}</p>}
            {job.problem.hint && <p className={classes["hint"]}>{job.problem.hint}</p>}
          </div>
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
