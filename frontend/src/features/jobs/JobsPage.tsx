import { Button, SegmentedControl, Skeleton } from "@mantine/core";
import { useState } from "react";
import { JOBS_PAGE, type JobState, useJobs, useReproductions } from "../../api/jobs";
import { ErrorNotice } from "../../ui/ErrorNotice";
import classes from "../../ui/Page.module.css";
import { addPage } from "../../ui/paging";
import { useTitle } from "../../ui/useTitle";
import { JobCard } from "./JobCard";

type Group = "failed" | "open" | "over";
type Filter = "all" | Group;

const GROUPS: Record<Group, { title: string; states: readonly JobState[]; none: string }> = {
  failed: { title: "Failed jobs", states: ["failed"], none: "No failed jobs." },
  open: { title: "Active jobs", states: ["queued", "running"], none: "No active jobs." },
  over: { title: "Finished jobs", states: ["done", "cancelled"], none: "No finished jobs." },
};
const ORDER = ["failed", "open", "over"] as const;
/** Number of failed jobs shown above the active ones. */
const FAILURES_FIRST = 3;

/** All jobs: failed, active, finished. */
export function JobsPage() {
  useTitle("Jobs");
  const [filter, setFilter] = useState<Filter>("all");
  const jobs = { failed: useGroup("failed", filter), open: useGroup("open", filter), over: useGroup("over", filter) };
  const titles = new Map((useReproductions().data?.items ?? []).map(({ name, title }) => [name, title]));
  const shown = ORDER.filter((group) => filter === "all" || filter === group);
  const isPending = shown.some((group) => jobs[group].isPending);
  const isEmpty = !isPending && shown.every((group) => jobs[group].total === 0);
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
            { value: "failed", label: "Failed" },
            { value: "open", label: "Active" },
            { value: "over", label: "Finished" },
          ]}
        />
      </div>
      <ErrorNotice error={shown.map((group) => jobs[group].error).find((error) => error !== null)} />
      {isPending && <Skeleton height={240} radius="md" aria-busy="true" />}
      {isEmpty && (
        <p className={classes["none"]}>
          {filter === "all"
            ? "No jobs yet. Proposals, error landscapes and reproductions appear here."
            : GROUPS[filter].none}
        </p>
      )}
      <div className={classes["stack"]}>
        {shown
          .filter((group) => jobs[group].total > 0)
          .map((group) => (
            <JobGroup key={group} group={group} found={jobs[group]} titles={titles} onAll={() => setFilter(group)} />
          ))}
      </div>
    </>
  );
}

function useGroup(group: Group, filter: Filter) {
  const isBrief = group === "failed" && filter === "all";
  const query = useJobs(GROUPS[group].states, isBrief ? FAILURES_FIRST : JOBS_PAGE);
  const items = query.data?.pages.flatMap((page) => page.items) ?? [];
  return { ...query, isBrief, items, total: query.data?.pages[0]?.total ?? 0 };
}

interface JobGroupProps {
  group: Group;
  found: ReturnType<typeof useGroup>;
  titles: ReadonlyMap<string, string>;
  onAll: () => void;
}

function JobGroup({ group, found: { items, total, isBrief, ...query }, titles, onAll }: JobGroupProps) {
  const { title } = GROUPS[group];
  return (
    <section>
      <h2 className={classes["section"]}>{title}</h2>
      <ul className={classes["list"]} aria-label={title}>
        {items.map((job) => (
          <JobCard key={job.id} job={job} titles={titles} />
        ))}
      </ul>
      {query.hasNextPage && (
        <div className={classes["more"]}>
          <Button
            variant="default"
            loading={query.isFetchingNextPage}
            onClick={() => (isBrief ? onAll() : void addPage(query))}
          >
            {isBrief ? `Show all ${total} failed jobs` : `Show more (${items.length} of ${total})`}
          </Button>
        </div>
      )}
    </section>
  );
}
