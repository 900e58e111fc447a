import { Box } from "@mantine/core";
import type { Job } from "../../api/jobs";
import { Note } from "../../ui/Note";
import classes from "./JobProgress.module.css";
import { progressText } from "./jobs";

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
