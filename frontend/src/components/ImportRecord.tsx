import { Button, FileButton } from "@mantine/core";
import { IconFileUpload } from "@tabler/icons-react";
import type { RecordUpload } from "../api/mutations";
import classes from "./NextFlight.module.css";
import { Trouble } from "./Trouble";

interface Props {
  upload: RecordUpload;
  trialId?: number;
  proposalId?: number;
}

/** Hand in the record of a flight made elsewhere with these gains. */
export function ImportRecord({ upload, trialId, proposalId }: Props) {
  return (
    <div className={classes["stack"]}>
      <p className={classes["quiet"]}>
        Set these gains on your vehicle, fly, and hand in the record: a CSV file with the columns <code>time_s</code>{" "}
        (seconds since the command) and <code>altitude_m</code>.
      </p>
      <FileButton
        accept="text/csv,.csv"
        onChange={(file) =>
          file !== null &&
          upload.mutate({
            file,
            ...(trialId === undefined ? {} : { trialId }),
            ...(proposalId === undefined ? {} : { proposalId }),
          })
        }
      >
        {(props) => (
          <Button
            {...props}
            fullWidth
            size="lg"
            loading={upload.isPending}
            leftSection={<IconFileUpload size={22} aria-hidden />}
          >
            Upload flight record
          </Button>
        )}
      </FileButton>
      <Trouble error={upload.error} />
    </div>
  );
}
