import { Button, Group, Stack, TextInput } from "@mantine/core";
import { IconAlertTriangle, IconCircleCheck } from "@tabler/icons-react";
import { type ReactNode, useState } from "react";
import { useActs } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { gainText } from "../../ui/format";
import { ListTable } from "../../ui/ListTable";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { parametersOf } from "./fleet";

/** After this, what was found then says nothing of the vehicle. */
const OUTDATED: Partial<Record<Vehicle["state"], string>> = {
  quarantined: ", before the quarantine: outdated",
  disconnected: ", before the vehicle was disconnected: outdated",
};

const STEPS_REQUIRE = "Altitude steps require more, which is checked before each such flight.";

/** Sends a request when pressed, and shows that it is under way. */
export interface ButtonRequest {
  loading: boolean;
  onClick: () => void;
}

/** Result of a check in words, with its colour and icon. */
export function CheckResult({ passed, children }: { passed: boolean; children: ReactNode }) {
  const Icon = passed ? IconCircleCheck : IconAlertTriangle;
  return (
    <Group gap={6} wrap="nowrap" c={passed ? "var(--best)" : "var(--bad)"} fw={650}>
      <Icon size={18} aria-hidden />
      {children}
    </Group>
  );
}

/** A cell with a remark below it, if any. */
export const remarked = (what: ReactNode, remark: string | false) => (
  <>
    {what}
    {remark && <small>{remark}</small>}
  </>
);

/** All items of the last preflight check; outdated ones are grey. */
export function CheckList({ vehicle: { checks, checked_at, state } }: { vehicle: Vehicle }) {
  if (checks === null) {
    return (
      <Note>
        {state === "disconnected" ? "Not checked yet." : "Not checked since it was connected, restarted or released."}{" "}
        All items are checked again before every flight. {STEPS_REQUIRE}
      </Note>
    );
  }
  return (
    <>
      <div style={state in OUTDATED ? { filter: "grayscale(1)", opacity: 0.75 } : undefined}>
        <ListTable
          label="Preflight checks"
          className={classes["table"]}
          rows={checks}
          keyOf={({ name }) => name}
          columns={[
            {
              title: "Item",
              isHeading: true,
              cell: ({ title, passed, hint }) => remarked(title, !passed && hint),
            },
            {
              title: "Result",
              isText: true,
              cell: ({ passed }) => <CheckResult passed={passed}>{passed ? "passed" : "failed"}</CheckResult>,
            },
            { title: "Found", isText: true, cell: ({ found, needed }) => remarked(found, `required: ${needed}`) },
          ]}
        />
      </div>
      <Note>
        Checked <Time at={checked_at} />
        {OUTDATED[state] ?? ""}. {STEPS_REQUIRE}
      </Note>
    </>
  );
}

interface Props {
  vehicleId: number;
  mayRead: boolean;
  /** Props of the button that reads them. */
  read: ButtonRequest;
}

/** All parameters of the vehicle, as last read. */
export function ParameterPanel({ vehicleId, mayRead, read }: Props) {
  const [wanted, setWanted] = useState("");
  const acts = useActs(vehicleId).data?.items ?? [];
  const latest = acts.find(({ kind }) => kind === "parameters");
  const done = acts.find(({ kind, state }) => kind === "parameters" && state === "done");
  const underWay = latest?.state === "requested" || latest?.state === "running";
  const parameters = parametersOf(done?.result ?? null);
  const found = parameters.filter(([name]) => name.toLowerCase().includes(wanted.trim().toLowerCase()));
  return (
    <Panel
      title="Parameters"
      className={classes["wide"]}
      tools={
        <Button variant="default" {...read} disabled={!mayRead || underWay} loading={read.loading || underWay}>
          Read parameters
        </Button>
      }
    >
      <Stack gap={14}>
        {parameters.length === 0 ? (
          <Note>
            {latest?.state === "failed" ? latest.problem : "Not read yet. Reading all parameters takes a few seconds."}
          </Note>
        ) : (
          <>
            <TextInput
              label={`Search ${parameters.length} parameters`}
              value={wanted}
              onChange={(event) => setWanted(event.currentTarget.value)}
            />
            <ListTable
              label="Parameters"
              framed
              className={classes["table"]}
              rows={found}
              keyOf={([name]) => name}
              columns={[
                { title: "Parameter", hidesTitle: true, isHeading: true, cell: ([name]) => name },
                {
                  title: "Value",
                  hidesTitle: true,
                  cell: ([, value]) => <span title={String(value)}>{gainText(value)}</span>,
                },
              ]}
            />
            <Note>
              Read <Time at={done?.finished_at} />.
            </Note>
          </>
        )}
      </Stack>
    </Panel>
  );
}
