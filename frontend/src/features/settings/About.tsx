import type { System } from "../../api/system";
import { bytesText } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { Panel } from "../../ui/Panel";
import fleet from "../fleet/Fleet.module.css";

const SCARCE_BYTES = 1e9;

/** Version and resources of the server, for bug reports. */
export function About({ system }: { system: System }) {
  const scarce = system.free_bytes < SCARCE_BYTES;
  return (
    <Panel title="This server">
      <dl className={fleet["facts"]}>
        <LabelledValue title="Gainline" value={system.version} />
        <LabelledValue title="Worker" value={system.worker} bad={system.worker !== "running"} />
        <LabelledValue title="Database" value={`revision ${system.database_revision}`} />
        <LabelledValue title="Data" value={bytesText(system.data_bytes)} />
        <LabelledValue
          title={scarce ? "Free disk space, low" : "Free disk space"}
          value={bytesText(system.free_bytes)}
          bad={scarce}
        />
        <LabelledValue title="Data folder" value={system.data_dir} />
      </dl>
    </Panel>
  );
}
