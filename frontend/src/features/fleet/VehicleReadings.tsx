import { Button, Group, Stack, TextInput } from "@mantine/core";
import { IconAlertTriangle, IconCircleCheck } from "@tabler/icons-react";
import { type ReactNode, useState } from "react";
import { useActs } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { gainText } from "../../ui/format";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import table from "../../ui/ScrollTable.module.css";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { parametersOf } from "./fleet";

/** After this, what was found then says nothing of the vehicle. */
const OUTDATED: Partial<Record<Vehicle["state"], string>> = {
  quarantined: ", before the quarantine: outdated",
  disconnected: ", before the vehicle was disconnected: outdated",
};

const STEPS_REQUIRE = "Altitude steps require more, which is checked before each such flight.";

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
      <div
        className={table["scroll"]}
        style={state in OUTDATED ? { filter: "grayscale(1)", opacity: 0.75 } : undefined}
      >
        <table className={`${table["table"]} ${classes["table"]}`}>
          <thead>
            <tr>
              <th scope="col">Item</th>
              <th scope="col">Result</th>
              <th scope="col">Found</th>
            </tr>
          </thead>
          <tbody>
            {checks.map(({ name, title, passed, found, needed, hint }) => (
              <tr key={name}>
                <th scope="row">
                  {title}
                  {!passed && hint && <small>{hint}</small>}
                </th>
                <td>
                  <CheckResult passed={passed}>{passed ? "passed" : "failed"}</CheckResult>
                </td>
                <td>
                  {found}
                  <small>required: {needed}</small>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
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
  reading: boolean;
  onRead: () => void;
}

/** All parameters of the vehicle, as last read. */
export function ParameterPanel({ vehicleId, mayRead, reading, onRead }: Props) {
  const [wanted, setWanted] = useState("");
  const acts = useActs(vehicleId).data?.items ?? [];
  const latest = acts.find(({ kind }) => kind === "parameters");
  const read = acts.find(({ kind, state }) => kind === "parameters" && state === "done");
  const underWay = latest?.state === "requested" || latest?.state === "running";
  const parameters = parametersOf(read?.result ?? null);
  const found = parameters.filter(([name]) => name.toLowerCase().includes(wanted.trim().toLowerCase()));
  return (
    <Panel
      title="Parameters"
      className={classes["wide"]}
      tools={
        <Button variant="default" disabled={!mayRead || underWay} loading={reading || underWay} onClick={onRead}>
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
            {/* biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard */}
            <section style={{ maxHeight: 420, overflow: "auto" }} aria-label="Parameters" tabIndex={0}>
              <table className={`${table["table"]} ${classes["table"]}`}>
                <tbody>
                  {found.map(([name, value]) => (
                    <tr key={name}>
                      <th scope="row">{name}</th>
                      <td data-number title={String(value)}>
                        {gainText(value)}
                      </td>
                    </tr>
                  ))}
                </tbody>
              </table>
            </section>
            <Note>
              Read <Time at={read?.finished_at} />.
            </Note>
          </>
        )}
      </Stack>
    </Panel>
  );
}
