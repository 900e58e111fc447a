import { Button, Checkbox, Stack } from "@mantine/core";
import { navigate } from "wouter/use-browser-location";
import { type LogPlace, useDeleteLog, useKeepLog, useSentLog } from "../../api/logAnalyses";
import { bytesText } from "../../ui/format";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { Question } from "../../ui/Question";
import { Time } from "../../ui/Time";
import { VehicleLink } from "./LogTable";
import { NameForm } from "./NameForm";

interface Props {
  log: LogPlace;
}

/** Whether a log is kept, and of which vehicle; keeps or deletes it. */
export function LogPlacePanel({ log }: Props) {
  const { vehicle, program } = log;
  const keep = useKeepLog(log.id);
  const { files, isRepeated } = useSentLog(log.id);
  const remove = useDeleteLog(log.id, () => navigate("/log-analysis"));
  return (
    <Panel
      title={
        vehicle ? (
          <>
            Kept as a log of <VehicleLink vehicle={vehicle} />
          </>
        ) : (
          "Keep this log"
        )
      }
      tools={
        <Question
          act="Delete log"
          question={`Delete this log? Its answer${log.file_bytes > 0 ? " and its file are" : " is"} lost.`}
          otherwise="Cancel"
          mutation={remove}
        />
      }
    >
      <Stack gap={12}>
        <Note {...(isRepeated && { role: "status" })}>
          {isRepeated ? "Analysed before, on " : "Analysed on "}
          <Time at={log.analysed_at} />, by Gainline {program}.
          {vehicle === null && " It is deleted seven days later unless it is kept."}
          {log.file_bytes > 0 && ` Its file is stored too, ${bytesText(log.file_bytes)}.`}
        </Note>
        <ErrorNotice error={vehicle && keep.error} />
        {vehicle === null && log.is_recognised && <Note>Recognised by its hardware id.</Note>}
        {vehicle === null && (
          <NameForm
            key={log.suggested_name}
            label="Vehicle"
            name={log.suggested_name}
            isFixed={log.is_recognised}
            submit={log.is_recognised ? `Keep as a log of ${log.suggested_name}` : "Keep"}
            mutation={keep}
            onSubmit={(name, entered) => keep.mutate({ name, files: entered.has("file") ? files : null })}
          >
            {files && <Checkbox size="md" my={12} name="file" label="Store the file too" />}
          </NameForm>
        )}
        {vehicle && log.file_bytes === 0 && files && (
          <Button
            variant="default"
            w="fit-content"
            loading={keep.isPending}
            onClick={() => keep.mutate({ name: vehicle.name, files })}
          >
            Store the file too
          </Button>
        )}
      </Stack>
    </Panel>
  );
}
