import { Button, SegmentedControl, Skeleton } from "@mantine/core";
import { useState } from "react";
import { type JobState, useJobs, useReproductions } from "../api/work";
import { JobCard } from "../components/JobCard";
import { Trouble } from "../components/Trouble";
import { useTitle } from "../components/useTitle";
import classes from "./WorkPages.module.css";

type Filter = "all" | "open" | "failed";

const STATES: Record<Filter, JobState[]> = { all: [], open: ["queued", "running"], failed: ["failed"] };
const NONE: Record<Filter, string> = {
  all: "Nothing has been computed yet. Proposals and reproductions appear here.",
  open: "Nothing waits and nothing runs.",
  failed: "Nothing has failed.",
};

/** Numeric work: what waits, what runs and how far it is, what failed and why. */
export function JobsPage() {
  useTitle("Jobs");
  const [filter, setFilter] = useState<Filter>("all");
  const jobs = useJobs(STATES[filter]);
  const titles = new Map((useReproductions().data?.items ?? []).map(({ name, title }) => [name, title]));
  const found = jobs.data?.pages.flatMap((page) => page.items) ?? [];
  const total = jobs.data?.pages[0]?.total ?? 0;
  return (
    <>
      <div className={classes["head"]}>
        <h1 className={classes["title"]}>Jobs</h1>
        <SegmentedControl
          aria-label="Jobs shown"
          size="md"
          value={filter}
          onChange={(value) => setFilter(value as Filter)}
          data={[
            { value: "all", label: "All" },
            { value: "open", label: "Under way" },
            { value: "failed", label: "Failed" },
          ]}
        />
      </div>
      <Trouble error={jobs.error} />
      {jobs.isPending && <Skeleton height={240} radius="md" aria-busy="true" />}
      {jobs.data && found.length === 0 && <p className={classes["none"]}>{NONE[filter]}</p>}
      <ul className={classes["list"]} aria-label="Jobs">
        {found.map((job) => (
          <JobCard key={job.id} job={job} titles={titles} />
        ))}
      </ul>
      {jobs.hasNextPage && (
        <div className={classes["more"]}>
          <Button variant="default" loading={jobs.isFetchingNextPage} onClick={() => void jobs.fetchNextPage()}>
            Show more ({found.length} of {total})
          </Button>
        </div>
      )}
    </>
  );
}
