import { Button, Skeleton } from "@mantine/core";
import { useActs } from "../../api/fleet";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { Panel } from "../../ui/Panel";
import { addPage } from "../../ui/paging";
import { ScrollTable } from "../../ui/ScrollTable";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { ACTS } from "./fleet";

/** Requests to the vehicle besides its flights: who, when, outcome. */
export function RequestList({ vehicleId }: { vehicleId: number }) {
  const acts = useActs(vehicleId);
  const items = acts.data?.pages.flatMap((page) => page.items) ?? [];
  return (
    <Panel title="Requests" className={classes["wide"]}>
      <ErrorNotice error={acts.error} />
      {acts.isPending && <Skeleton height={120} aria-busy="true" />}
      <ScrollTable label="Requests" className={classes["table"]}>
        <thead>
          <tr>
            <th scope="col">Request</th>
            <th scope="col">Time</th>
            <th scope="col">Outcome</th>
          </tr>
        </thead>
        <tbody>
          {items.map((act) => (
            <tr key={act.id}>
              <td>
                {ACTS[act.kind]}
                {act.reason && <small>{act.reason}</small>}
              </td>
              <td>
                <Time at={act.requested_at} />
                {act.by && <small>by {act.by}</small>}
              </td>
              <td>
                {act.state}
                {act.problem && <small>{act.problem}</small>}
              </td>
            </tr>
          ))}
        </tbody>
      </ScrollTable>
      {acts.hasNextPage && (
        <Button variant="default" mt={12} loading={acts.isFetchingNextPage} onClick={() => void addPage(acts)}>
          Show more ({items.length} of {acts.data?.pages[0]?.total})
        </Button>
      )}
    </Panel>
  );
}
