import { Button, type ButtonProps, FileButton, Group, Skeleton, Text } from "@mantine/core";
import { IconFileUpload, IconPlayerPlay } from "@tabler/icons-react";
import { type ReactNode, useRef } from "react";
import { ANALYSED_FILES } from "../../api/logAnalyses";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import classes from "./LogAnalysis.module.css";
import type { OngoingAnalysis } from "./useAnalysis";

interface Props {
  analysis: OngoingAnalysis;
}

/** Opens the file chooser. */
export function ChooseLog({ analysis, variant = "default", children = "Choose log" }: Props & ButtonProps) {
  const reset = useRef<() => void>(null);
  const choose = (chosen: readonly File[]): void => {
    analysis.choose(chosen);
    reset.current?.();
  };
  return (
    <FileButton multiple accept={ANALYSED_FILES} onChange={choose} resetRef={reset}>
      {(props) => (
        <Button
          {...props}
          variant={variant}
          loading={analysis.isPending}
          leftSection={<IconFileUpload size={20} aria-hidden />}
        >
          {children}
        </Button>
      )}
    </FileButton>
  );
}

/** The place where a log is dropped or chosen, or the example. */
export function LogDrop({ analysis, title, children }: Props & { title: string; children: ReactNode }) {
  return (
    <Panel title={title} className={`${classes["drop"]} ${analysis.isOver ? classes["over"] : ""}`}>
      {children}
      <Group gap={10} mt={12}>
        <ChooseLog analysis={analysis} variant="filled" />
        <Button
          variant="subtle"
          disabled={analysis.isPending}
          leftSection={<IconPlayerPlay size={18} aria-hidden />}
          onClick={() => analysis.analyze({ files: null })}
        >
          Analyse example log
        </Button>
      </Group>
    </Panel>
  );
}

/** How far the analysis is, or why there is none; nothing before it begins. */
export function Progress({ analysis: { isPending, error, name } }: Props) {
  if (isPending) {
    return (
      <Panel title={name}>
        <p aria-live="polite">Analysing the log. This takes about 10 seconds.</p>
        <Skeleton height={120} mt={12} radius="md" aria-hidden />
      </Panel>
    );
  }
  if (error === null) return null;
  return (
    <div>
      <Text fw={650}>{name}</Text>
      <ErrorNotice error={error} />
    </div>
  );
}

/** Where something needs the file of a log, which is not stored and which this tab does not have. */
export function FileNeeded({ analysis, name, what }: Props & { name: string; what: string }) {
  return (
    <Group gap="8px 14px">
      <Note style={{ overflowWrap: "anywhere" }}>
        {what} needs the file {name}, which is not stored.
      </Note>
      <ChooseLog analysis={analysis}>Choose file</ChooseLog>
    </Group>
  );
}
