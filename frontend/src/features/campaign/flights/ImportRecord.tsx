import { Button, FileButton, Stack } from "@mantine/core";
import { IconFileUpload } from "@tabler/icons-react";
import type { RecordOrder, RecordUpload } from "../../../api/mutations";
import { problemOf } from "../../../api/problems";
import { confirmationIn, READINGS, RECORD_FILES, readingsIn, recordOf, takeoffsIn } from "../../../api/records";
import type { NewTrial } from "../../../api/types";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import page from "../CampaignPage.module.css";

interface Props {
  upload: RecordUpload;
  /** The planned trial of the record, or the trial to plan with it; null until there is one. */
  target: { trialId: number } | { plan: NewTrial } | null;
}

const ACCEPT = { confirm: "Import with the gains in the log", invalid: "Store as an invalid flight" };

/** Upload of the record of a flight made elsewhere with these gains. */
export function ImportRecord({ upload, target }: Props) {
  const problem = problemOf(upload.error);
  const accepting = confirmationIn(problem);
  const readings = readingsIn(problem);
  const again = (answer: Partial<RecordOrder>) =>
    upload.variables !== undefined && upload.mutate({ ...upload.variables, ...target, ...answer });
  return (
    <Stack gap={14}>
      <Note fz="body">
        Set these gains on your vehicle, fly, and upload the log: MAVLink .tlog, ArduPilot .bin, PX4 .ulg, Paparazzi
        .data (with its .log), or a CSV file with the columns <code>time_s</code> (seconds since the takeoff command)
        and <code>altitude_m</code>.
      </Note>
      <FileButton
        multiple
        accept={RECORD_FILES}
        onChange={(files) => {
          const record = recordOf(files);
          if (record !== null) upload.mutate({ ...record, ...target });
        }}
      >
        {(props) => (
          <Button
            {...props}
            fullWidth
            size="lg"
            loading={upload.isPending}
            disabled={target === null}
            leftSection={<IconFileUpload size={22} aria-hidden />}
          >
            Upload flight record
          </Button>
        )}
      </FileButton>
      <ErrorNotice error={upload.error} shown={["takeoff", "confirm", "invalid", "reads_as"]} />
      {takeoffsIn(problem).map(({ number, summary }) => (
        <Button key={number} variant="default" className={page["wrapping"]} onClick={() => again({ takeoff: number })}>
          Takeoff {number}: {summary}
        </Button>
      ))}
      {readings.length > 0 && (
        <Button
          variant="default"
          className={page["wrapping"]}
          onClick={() => again({ reads_as: [...(upload.variables?.reads_as ?? []), ...readings] })}
        >
          Read it with {readings.map((reading) => READINGS[reading]).join(", ")}
        </Button>
      )}
      {accepting !== null && (
        <Button variant="default" onClick={() => again({ [accepting]: true })}>
          {ACCEPT[accepting]}
        </Button>
      )}
    </Stack>
  );
}
