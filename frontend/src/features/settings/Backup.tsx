import { Button, Stack } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useDownload } from "../../api/files";
import { BACKUP, type System } from "../../api/system";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { bytesText } from "../../ui/format";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import classes from "./SettingsPage.module.css";

/** Download of a backup, and how to restore it. */
export function Backup({ system }: { system: System }) {
  const backup = useDownload(BACKUP);
  return (
    <Panel title="Backup">
      <Stack gap={18}>
        <Note>
          One file with the current state of all campaigns, flights and vehicles, about{" "}
          {bytesText(system.database_bytes)}. Flights and computations continue during the download. Telemetry logs
          (folder tlogs) are not included.
        </Note>
        <div>
          <Button
            leftSection={<IconDownload size={18} aria-hidden />}
            loading={backup.isPending}
            onClick={() => backup.mutate()}
          >
            Download backup
          </Button>
        </div>
        <ErrorNotice error={backup.error} />
        <details className={classes["details"]}>
          <summary>How to restore a backup</summary>
          <ol>
            <li>Stop Gainline.</li>
            <li>
              In {system.data_dir}, delete gainline.sqlite3-wal and gainline.sqlite3-shm, and move gainline.sqlite3
              away.
            </li>
            <li>Copy the backup there as gainline.sqlite3.</li>
            <li>Start Gainline. A backup of an earlier version is migrated.</li>
          </ol>
        </details>
      </Stack>
    </Panel>
  );
}
