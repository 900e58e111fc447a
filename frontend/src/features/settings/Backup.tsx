import { Button } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useDownload } from "../../api/files";
import { BACKUP, type System } from "../../api/system";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { bytesText } from "../../ui/format";
import { Panel } from "../../ui/Panel";
import classes from "./SettingsPage.module.css";

/** A copy of everything, and how it comes back. */
export function Backup({ system }: { system: System }) {
  const backup = useDownload(BACKUP);
  return (
    <Panel title="Backup">
      <div className={classes["stack"]}>
        <p className={classes["quiet"]}>
          One file with every campaign, flight and vehicle as they are at this moment, about{" "}
          {bytesText(system.database_bytes)}. Flights and computations go on meanwhile. Telemetry logs (folder tlogs)
          are not in it.
        </p>
        <div>
          <Button
            leftSection={<IconDownload size={18} aria-hidden />}
            loading={backup.isPending}
            onClick={() => backup.mutate()}
          >
            Download a backup
          </Button>
        </div>
        <ErrorNotice error={backup.error} />
        <details className={classes["details"]}>
          <summary>How to restore it</summary>
          <ol>
            <li>Stop Gainline.</li>
            <li>
              In {system.data_dir}, delete gainline.sqlite3-wal and gainline.sqlite3-shm, and move gainline.sqlite3
              away.
            </li>
            <li>Put the backup there under the name gainline.sqlite3.</li>
            <li>Start Gainline. A backup of an earlier version is brought up to date.</li>
          </ol>
        </details>
      </div>
    </Panel>
  );
}
