import { Group, Skeleton, Stack, Text } from "@mantine/core";
import { useSearchParams } from "wouter";
import {
  type LogComparison,
  type LogPlace,
  type ParameterChange,
  useLogComparison,
  useLogsOf,
} from "../../api/logAnalyses";
import { Aside, toneOf } from "../../ui/Aside";
import { StateBadge } from "../../ui/Badges";
import { SelectField } from "../../ui/Fields";
import { localTime } from "../../ui/format";
import { type Column, ListTable } from "../../ui/ListTable";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { bad, good, quiet, type StateLabel } from "../../ui/states";
import { confidenceText, plusMinus } from "../../ui/uncertainty";
import { changeText, parameterGroups, parameterText, QUANTITIES, quantityText } from "./readings";

const SAME = "same gains";

const VERDICTS: Record<NonNullable<LogComparison["verdict"]> | typeof SAME, StateLabel> = {
  [SAME]: quiet("Same gains"),
  better: good("Better gains"),
  worse: bad("Worse gains"),
  unresolved: quiet("Unresolved"),
  "not known yet": quiet("Not known yet"),
};

interface Props {
  log: LogPlace;
  vehicle: NonNullable<LogPlace["vehicle"]>;
}

/** A kept log compared with the one before it, or with another one of its vehicle; the URL names that one. */
export function Comparison({ log, vehicle }: Props) {
  const [params, setParams] = useSearchParams();
  const logs = useLogsOf(vehicle.id);
  const others = (logs.data ?? []).filter(({ id }) => id !== log.id);
  const before = Number(params.get("before")) || log.previous_id;
  const choices = others.map(({ id, file_name, flown_at, analysed_at }) => ({
    value: String(id),
    label: `${file_name}, ${localTime(flown_at ?? analysed_at)}${id === log.previous_id ? " (the one before)" : ""}`,
  }));
  return (
    <Panel
      title="Compared with"
      tools={
        others.length > 0 && (
          <SelectField
            aria-label="Compared with"
            value={String(before ?? "")}
            data={before === null ? [{ value: "", label: "Choose a log…" }, ...choices] : choices}
            onChange={(chosen) => setParams({ before: chosen }, { replace: true })}
          />
        )
      }
    >
      <ErrorNotice error={logs.error} />
      {before === null && (
        <Note>
          This is the {others.length > 0 ? "first" : "only"} log of {vehicle.name}. The next one is compared with it.
        </Note>
      )}
      {before !== null && <Compared logId={log.id} before={before} />}
    </Panel>
  );
}

const VALUES: readonly Column<ParameterChange>[] = [
  { title: "Other log", cell: ({ before }) => parameterText(before) },
  { title: "This log", cell: ({ after }) => parameterText(after) },
];

function Compared({ logId, before }: { logId: number; before: number }) {
  const { data, error } = useLogComparison(logId, before);
  if (!data) return error ? <ErrorNotice error={error} /> : <Skeleton height={240} aria-busy="true" />;
  const { verdict, confidence, change, sentence, notes, parameters } = data;
  return (
    <Stack gap={14}>
      <Aside tone={toneOf(verdict)} role="status">
        <Group gap="4px 14px">
          <StateBadge words={VERDICTS[verdict ?? SAME]} />
          {change.by_gains_m !== null && (
            <Text fw={650}>
              {plusMinus(1000 * change.by_gains_m, 1000 * (change.standard_error_m ?? 0), "mm")} by the gains
            </Text>
          )}
          {confidence !== null && <Note>{confidenceText(confidence)} confidence</Note>}
        </Group>
        {sentence && <Text maw="90ch">{sentence}</Text>}
      </Aside>
      <ListTable
        stacks
        label="Numbers of both logs"
        rows={QUANTITIES}
        keyOf={({ title }) => title}
        columns={[
          { title: "Flight", isHeading: true, cell: ({ title }) => title },
          { title: "Other log", cell: (quantity) => quantityText(quantity, data.before.numbers) },
          { title: "This log", cell: (quantity) => quantityText(quantity, data.log.numbers) },
          { title: "Change", cell: (quantity) => changeText(quantity, data.before.numbers, data.log.numbers) },
        ]}
      />
      {parameters.length === 0 && <Note>No parameter differs.</Note>}
      {parameterGroups(parameters).map(({ group, title, parameters: changed }) => (
        <details key={group} open={group === "gain" || group === "loop"}>
          <summary>
            {title}: {changed.length} changed
          </summary>
          <ListTable
            framed
            stacks
            label={title}
            rows={changed}
            keyOf={({ name }) => name}
            columns={[{ title: "Parameter", isHeading: true, cell: ({ name }) => name }, ...VALUES]}
          />
        </details>
      ))}
      {notes.length > 0 && (
        <ul className={page["notes"]}>
          {notes.map((note) => (
            <li key={note}>{note}</li>
          ))}
        </ul>
      )}
    </Stack>
  );
}
