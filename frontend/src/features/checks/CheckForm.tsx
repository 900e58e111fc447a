import { Button, FileButton, Group, Text, TextInput } from "@mantine/core";
import { IconFileUpload, IconPlayerPlay } from "@tabler/icons-react";
import { useEffect, useRef, useState } from "react";
import { useNavigate } from "react-router";
import { type RecordingCheck, useCheckExample } from "../../api/checks";
import { problemOf } from "../../api/problems";
import { useCatalogue } from "../../api/queries";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import classes from "./Checks.module.css";

interface Props {
  upload: RecordingCheck;
  onCheck: (files: readonly File[], gains?: string) => void;
  /** Whether a file is dragged over the page. */
  over: boolean;
  /** Whether to omit the introduction. */
  brief: boolean;
}

/** Upload form for a recording, with an introduction and an example. */
export function CheckForm({ upload, onCheck, over, brief }: Props) {
  const example = useCheckExample();
  const autopilots = useCatalogue().data?.autopilots ?? [];
  const navigate = useNavigate();
  return (
    <Panel
      title={brief ? "Check another recording" : "Check that the replica matches your vehicle’s controller"}
      className={over ? classes["over"] : ""}
    >
      {!brief && (
        <Text maw="90ch" lh={1.45} mb={10}>
          Upload a recorded run of the autopilot's vertical loop. Every signal is compared with Gainline's replica of
          the controller: bit for bit for Paparazzi, within tolerances for the others.
        </Text>
      )}
      <Text maw="90ch" lh={1.45} mb={10}>
        Drop a file here or choose one. The file is not stored.
      </Text>
      <ul className={page["notes"]}>
        {autopilots.map(({ name, title, recordings }) => (
          <li key={name}>
            {title}: {recordings}.
          </li>
        ))}
      </ul>
      <Group gap={10} align="end" mt={12} mb={10}>
        <FileButton
          multiple
          accept={autopilots.flatMap(({ recording_types }) => recording_types).join()}
          onChange={(files) => onCheck(files)}
        >
          {(props) => (
            <Button {...props} loading={upload.isPending} leftSection={<IconFileUpload size={20} aria-hidden />}>
              Choose recording
            </Button>
          )}
        </FileButton>
        <Button
          variant="default"
          loading={example.isPending}
          leftSection={<IconPlayerPlay size={18} aria-hidden />}
          onClick={() => example.mutate(undefined, { onSuccess: ({ id }) => void navigate(`/controller/${id}`) })}
        >
          Check example
        </Button>
      </Group>
      <ErrorNotice error={example.error} />
    </Panel>
  );
}

/** Why a recording was not checked, above the result of an earlier one; renders nothing without a refusal. */
export function RefusedRecording({ upload, onCheck }: Pick<Props, "upload" | "onCheck">) {
  const notice = useRef<HTMLDivElement>(null);
  const { error, variables } = upload;
  useEffect(() => {
    if (error !== null) notice.current?.scrollIntoView({ block: "nearest" });
  }, [error]);
  if (error === null) return null;
  return (
    <div ref={notice} className={classes["refused"]}>
      <Panel title={`${variables?.file.name ?? "The recording"} was not checked`}>
        <ErrorNotice error={error} />
        <GainsAsked upload={upload} onCheck={onCheck} />
      </Panel>
    </div>
  );
}

/** Input for the gains of a log that does not contain them. */
function GainsAsked({ upload, onCheck }: Pick<Props, "upload" | "onCheck">) {
  const [gains, setGains] = useState("");
  const asked = problemOf(upload.error)?.problems.some(({ field }) => field === "gains") ?? false;
  const sent = upload.variables;
  if (!asked || sent === undefined) return null;
  return (
    <form
      className={classes["actions"]}
      onSubmit={(event) => {
        event.preventDefault();
        onCheck([sent.file, ...(sent.companion ? [sent.companion] : [])], gains.replaceAll(/\s+/g, ""));
      }}
    >
      <TextInput
        label="Gains flown: kp, ki, kd"
        placeholder="283, 13, 82"
        value={gains}
        onChange={(event) => setGains(event.currentTarget.value)}
      />
      <Button type="submit" disabled={gains === ""}>
        Check {sent.file.name} with these gains
      </Button>
    </form>
  );
}
