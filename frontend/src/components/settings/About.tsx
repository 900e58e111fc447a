import type { System } from "../../api/system";
import { bytesText } from "../../lib/format";
import { Fact } from "../fleet/Fact";
import fleet from "../fleet/Fleet.module.css";
import { Panel } from "../Panel";

const SCARCE_BYTES = 1e9;

/** What one is asked for when something is wrong. */
export function About({ system }: { system: System }) {
  const scarce = system.free_bytes < SCARCE_BYTES;
  return (
    <Panel title="This server">
      <dl className={fleet["facts"]}>
        <Fact title="Gainline" value={system.version} />
        <Fact title="Worker" value={system.worker} bad={system.worker !== "running"} />
        <Fact title="Database" value={`revision ${system.database_revision}`} />
        <Fact title="Data" value={bytesText(system.data_bytes)} />
        <Fact title={scarce ? "Free disk, scarce" : "Free disk"} value={bytesText(system.free_bytes)} bad={scarce} />
        <Fact title="Data folder" value={system.data_dir} />
      </dl>
    </Panel>
  );
}
