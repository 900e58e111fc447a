import { Button, Group, SegmentedControl, Skeleton, Stack, Title } from "@mantine/core";
import { useState } from "react";
import { JOBS_PAGE, type JobState, useJobs, useReproductions } from "../../api/jobs";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { ShowMore } from "../../ui/ShowMore";
import { useTitle } from "../../ui/useTitle";
import { JobTable } from "./JobTable";

const STATES = {
  Failed: ["failed"],
  Active: ["queued", "running"],
  Finished: ["done", "cancelled"],
} as const satisfies Record<string, readonly JobState[]>;
type GroupName = keyof typeof STATES;
type Filter = GroupName | "All";

/** Place of the button for more jobs. */
const BELOW = { mt: 20, mx: "auto", display: "block" };

/** Number of failed jobs shown above the active ones. */
const FAILURES_FIRST = 3;

/** All jobs: failed, active, finished. */
export function JobsPage() {
  useTitle("Jobs");
  const [filter, setFilter] = useState<Filter>("All");
  const groups = [useGroup("Failed", filter), useGroup("Active", filter), useGroup("Finished", filter)];
  const titles = new Map((useReproductions().data?.items ?? []).map(({ name, title }) => [name, title]));
  const shown = groups.filter(({ group }) => filter === "All" || filter === group);
  const isPending = shown.some(({ query }) => query.isPending);
  return (
    <>
      <Group justify="space-between" gap={12} mb={14}>
        <Title order={1}>Jobs</Title>
        <SegmentedControl
          aria-label="Jobs shown"
          size="md"
          value={filter}
          onChange={setFilter}
          data={["All", "Failed", "Active", "Finished"]}
        />
      </Group>
      <ErrorNotice error={shown.find(({ query }) => query.error !== null)?.query.error} />
      {isPending && <Skeleton height={240} radius="md" aria-busy="true" />}
      {!isPending && shown.every(({ total }) => total === 0) && (
        <Note py={48} ta="center">
          {filter === "All"
            ? "No jobs yet. Proposals, error landscapes and reproductions appear here."
            : `No ${filter.toLowerCase()} jobs.`}
        </Note>
      )}
      <Stack gap="var(--gap)">
        {shown
          .filter(({ total }) => total > 0)
          .map(({ group, items, total, isBrief, query }) => (
            <Panel key={group} title={`${group} jobs`}>
              <JobTable label={`${group} jobs`} jobs={items} titles={titles} />
              {isBrief && items.length < total ? (
                <Button variant="default" {...BELOW} onClick={() => setFilter(group)}>
                  Show all {total} failed jobs
                </Button>
              ) : (
                <ShowMore list={query} {...BELOW} />
              )}
            </Panel>
          ))}
      </Stack>
    </>
  );
}

function useGroup(group: GroupName, filter: Filter) {
  const isBrief = group === "Failed" && filter === "All";
  const query = useJobs(STATES[group], isBrief ? FAILURES_FIRST : JOBS_PAGE);
  return { query, group, isBrief, ...(query.data ?? { items: [], total: 0 }) };
}
