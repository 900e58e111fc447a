import { Button } from "@mantine/core";
import { useJudgeAbort } from "../../api/mutations";
import type { Trial } from "../../api/types";
import { ErrorNotice } from "../../ui/ErrorNotice";
import classes from "./Verdict.module.css";
import { abortSentence, abortWords } from "./verdict";

const LABELS = { "behaved badly": "The vehicle behaved badly", "something else": "Something else" } as const;

/** Whether an aborted flight counts against its gains, with buttons for the cause. */
export function AbortCause({ trial }: { trial: Trial }) {
  const judge = useJudgeAbort();
  const causes = abortWords(trial);
  const sentence = abortSentence(trial);
  if (sentence === "") return null;
  return (
    <section className={classes["abortCause"]} aria-label="Abort cause">
      <p role="status">{sentence}</p>
      {causes.length > 0 && (
        <div className={classes["causes"]}>
          {causes.map((cause) => (
            <Button
              key={cause}
              variant="default"
              loading={judge.isPending}
              onClick={() => judge.mutate({ trial, cause })}
            >
              {LABELS[cause]}
            </Button>
          ))}
        </div>
      )}
      <ErrorNotice error={judge.error} />
    </section>
  );
}
