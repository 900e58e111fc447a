import type { Job } from "../../api/jobs";
import classes from "./JobProgress.module.css";
import { progressText } from "./jobs";

/** Progress of a queued or running job. */
export function JobProgress({ job, title }: { job: Job; title: string }) {
  return (
    <div className={classes["progress"]}>
      <progress
        className={classes["bar"]}
        aria-label={title}
        aria-valuetext={progressText(job)}
        value={Math.floor(100 * (job.done_share ?? 0))}
        max={100}
      />
      <p className={`${classes["text"]} numbers`}>{progressText(job)}</p>
    </div>
  );
}
