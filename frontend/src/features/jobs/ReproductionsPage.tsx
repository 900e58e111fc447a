import { Button, Group, SimpleGrid, Skeleton, Title } from "@mantine/core";
import { IconPlayerPlay } from "@tabler/icons-react";
import { useEffect } from "react";
import { useReproductions, useRunReproduction } from "../../api/jobs";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { useTitle } from "../../ui/useTitle";
import { isUnderWay } from "./jobs";
import { ReproductionCard } from "./ReproductionCard";

/** All experiments, tables and figures of the paper, run here and compared with the published results. */
export function ReproductionsPage() {
  useTitle("Reproductions");
  const list = useReproductions();
  const run = useRunReproduction();
  const found = list.data?.items ?? [];
  const idle = found.filter(({ job }) => job === null || !isUnderWay(job));
  useScrollToHash(found.length > 0);
  return (
    <>
      <Group justify="space-between" gap={12} mb={14}>
        <Title order={1}>Reproductions</Title>
        <Button
          variant="default"
          leftSection={<IconPlayerPlay size={18} aria-hidden />}
          disabled={idle.length === 0}
          onClick={() => {
            for (const { name } of idle) run.mutate({ name });
          }}
        >
          Run all
        </Button>
      </Group>
      <Note maw="90ch" mb={18}>
        All experiments, tables and figures of the paper, run on this machine and compared with the published numbers.
        Flights and proposals have priority. A run can be cancelled and restarted at any time.
      </Note>
      <ErrorNotice error={list.error ?? run.error} />
      {list.isPending && <Skeleton height={320} radius="md" aria-busy="true" />}
      <SimpleGrid type="container" cols={{ base: 1, "1400px": 2 }} spacing="var(--gap)">
        {found.map((reproduction) => (
          <ReproductionCard key={reproduction.name} reproduction={reproduction} />
        ))}
      </SimpleGrid>
    </>
  );
}

/** Scroll to the URL's fragment once the list is loaded. */
function useScrollToHash(ready: boolean): void {
  useEffect(() => {
    const { hash } = window.location;
    if (ready && hash !== "") document.getElementById(hash.slice(1))?.scrollIntoView();
  }, [ready]);
}
