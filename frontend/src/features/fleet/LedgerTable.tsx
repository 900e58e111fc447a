import { Anchor, Button, Skeleton } from "@mantine/core";
import { Link } from "react-router";
import { useLedger } from "../../api/fleet";
import type { GivenGains } from "../../api/types";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { NOTHING } from "../../ui/format";
import { gainsInBrackets, sameHeld } from "../../ui/gains";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import { addPage } from "../../ui/paging";
import { ScrollTable } from "../../ui/ScrollTable";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { PURPOSES } from "./fleet";

/** All gain sets written to the vehicle, and the values read back. */
export function LedgerTable({ vehicleId }: { vehicleId: number }) {
  const ledger = useLedger(vehicleId);
  const lines = ledger.data?.pages.flatMap((page) => page.items) ?? [];
  return (
    <Panel title="Gain history" className={classes["wide"]}>
      <ErrorNotice error={ledger.error} />
      {ledger.isPending && <Skeleton height={120} aria-busy="true" />}
      {ledger.data && lines.length === 0 && <Note>No gains written yet.</Note>}
      {lines.length > 0 && (
        <ScrollTable label="Gain history" className={classes["table"]}>
          <thead>
            <tr>
              <th scope="col">Purpose</th>
              <th scope="col">Requested {Object.keys(lines[0]?.asked ?? {}).join(", ")}</th>
              <th scope="col">Read back</th>
              <th scope="col">Outcome</th>
            </tr>
          </thead>
          <tbody>
            {lines.map((line) => (
              <Line key={`${line.purpose} ${line.flight_id ?? line.act_id}`} line={line} />
            ))}
          </tbody>
        </ScrollTable>
      )}
      {ledger.hasNextPage && (
        <Button variant="default" mt={12} loading={ledger.isFetchingNextPage} onClick={() => void addPage(ledger)}>
          Show more ({lines.length} of {ledger.data?.pages[0]?.total})
        </Button>
      )}
    </Panel>
  );
}

function Line({ line }: { line: GivenGains }) {
  const { campaign_id, trial_id, read_back } = line;
  const differs = read_back !== null && !sameHeld(read_back, line.asked);
  return (
    <tr>
      <td>
        {campaign_id !== null && trial_id !== null ? (
          <Anchor component={Link} to={`/campaigns/${campaign_id}/flights/${trial_id}`}>
            {PURPOSES[line.purpose]}
          </Anchor>
        ) : (
          PURPOSES[line.purpose]
        )}
        <small>
          <Time at={line.asked_at} />
        </small>
      </td>
      <td className="numbers">{gainsInBrackets(line.asked)}</td>
      <td className={`numbers ${differs ? classes["differs"] : ""}`}>
        {read_back === null ? NOTHING : gainsInBrackets(read_back)}
      </td>
      <td>{line.outcome}</td>
    </tr>
  );
}
