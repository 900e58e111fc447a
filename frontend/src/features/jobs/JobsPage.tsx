import { Box, Button, Group, SegmentedControl, Skeleton, Stack, Title } from "@mantine/core";
import { useState } from "react";
import { JOBS_PAGE, type JobState, useJobs, useReproductions } from "../../api/jobs";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { addPage } from "../../ui/paging";
import { useTitle } from "../../ui/useTitle";
import { JobTable } from "./JobTable";

type GroupName = "failed" | "open" | "over";
type Filter = "all" | GroupName;

const GROUPS: Record<GroupName, { title: string; states: readonly JobState[]; none: string }> = {
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
      <Group justify="space-between" gap={12} mb={14}>
        <Title order={1}>Jobs</Title>
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
      </Group>
      <ErrorNotice error={shown.map((group) => jobs[group].error).find((error) => error !== null)} />
      {isPending && <Skeleton height={240} radius="md" aria-busy="true" />}
      {isEmpty && (
        <Note py={48} ta="center">
          {filter === "all"
            ? "No jobs yet. Proposals, error landscapes and reproductions appear here."
            : GROUPS[filter].none}
        </Note>
      )}
      <Stack gap="var(--gap)">
        {shown
          .filter((group) => jobs[group].total > 0)
          .map((group) => (
            <JobGroup key={group} group={group} found={jobs[group]} titles={titles} onAll={() => setFilter(group)} />
          ))}
      </Stack>
    </>
  );
}

function useGroup(group: GroupName, filter: Filter) {
  const isBrief = group === "failed" && filter === "all";
  const query = useJobs(GROUPS[group].states, isBrief ? FAILURES_FIRST : JOBS_PAGE);
  const items = query.data?.pages.flatMap((page) => page.items) ?? [];
  return { ...query, isBrief, items, total: query.data?.pages[0]?.total ?? 0 };
}

interface JobGroupProps {
  group: GroupName;
  found: ReturnType<typeof useGroup>;
  titles: ReadonlyMap<string, string>;
  onAll: () => void;
}

function JobGroup({ group, found: { items, total, isBrief, ...query }, titles, onAll }: JobGroupProps) {
  const { title } = GROUPS[group];
  return (
    <Panel title={title}>
      <JobTable label={title} jobs={items} titles={titles} />
      {query.hasNextPage && (
        <Box mt={20} ta="center">
          <Button
            variant="default"
            loading={query.isFetchingNextPage}
            onClick={() => (isBrief ? onAll() : void addPage(query))}
          >
            {isBrief ? `Show all ${total} failed jobs` : `Show more (${items.length} of ${total})`}
          </Button>
        </Box>
      )}
    </Panel>
  );
}
