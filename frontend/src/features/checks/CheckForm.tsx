import { Button, FileButton, TextInput } from "@mantine/core";
import { IconFileUpload, IconPlayerPlay } from "@tabler/icons-react";
import { useState } from "react";
import { useNavigate } from "react-router";
import { type RecordingCheck, useCheckExample } from "../../api/checks";
import { problemOf } from "../../api/problems";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { Panel } from "../../ui/Panel";
import classes from "./Checks.module.css";
import { RECORDINGS } from "./checks";

interface Props {
  upload: RecordingCheck;
  onCheck: (files: readonly File[], gains?: string) => void;
  /** Whether a file is held over the page. */
  over: boolean;
  /** Whether what a check is has been seen already. */
  brief: boolean;
}

/** Where a recording is handed in; it says what a check is good for, and shows one. */
export function CheckForm({ upload, onCheck, over, brief }: Props) {
  const example = useCheckExample();
  const navigate = useNavigate();
  return (
    <Panel
      title={brief ? "Check another recording" : "Is the controller in the model the one in your vehicle?"}
      className={over ? classes["over"] : ""}
    >
      {!brief && (
        <p className={classes["line"]}>
          The method works only if it is. Hand in a recorded run of the autopilot's vertical loop: it is replayed
          through the replica that the model flies, and every signal is compared, to the last bit where the recording
          allows.
        </p>
      )}
      <p className={classes["line"]}>
        Drop a file here or choose one: Paparazzi's <code>.data</code> file with <code>VERT_LOOP</code> in it (choose
        its <code>.log</code> too, which says which gains were flown), or a recording of every step as <code>.csv</code>{" "}
        or <code>.csv.gz</code>. It is not kept.
      </p>
      <div className={classes["actions"]}>
        <FileButton multiple accept={RECORDINGS} onChange={(files) => onCheck(files)}>
          {(props) => (
            <Button {...props} loading={upload.isPending} leftSection={<IconFileUpload size={20} aria-hidden />}>
              Choose a recording
            </Button>
          )}
        </FileButton>
        <Button
          variant="default"
          loading={example.isPending}
          leftSection={<IconPlayerPlay size={18} aria-hidden />}
          onClick={() => example.mutate(undefined, { onSuccess: ({ id }) => void navigate(`/controller/${id}`) })}
        >
          Check the example
        </Button>
      </div>
      <ErrorNotice error={upload.error ?? example.error} />
      <GainsAsked upload={upload} onCheck={onCheck} />
    </Panel>
  );
}

/** A log that does not say which gains were flown is checked with those that a person gives. */
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
        Check {sent.file.name} with these
      </Button>
    </form>
  );
}
