import { Button, Group, Stack, TextInput } from "@mantine/core";
import { IconAlertTriangle, IconCircleCheck } from "@tabler/icons-react";
import { useState } from "react";
import { useEditVehicle } from "../../api/fleet";
import { problemOf, reasonsByField } from "../../api/problems";
import type { Vehicle } from "../../api/types";
import { useVehicleStatus } from "../../live/store";
import { heldGains, isArmed } from "../../live/vehicleStatus";
import { type NumberEntry, NumberField } from "../../ui/Fields";
import { gainText, NOTHING } from "../../ui/format";
import { inOrder, RESTORED, safeGainsWritten, sameHeld } from "../../ui/gains";
import { HelpTip } from "../../ui/HelpTip";
import { Note } from "../../ui/Note";
import { FormErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import table from "../../ui/ScrollTable.module.css";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { unknownGainsText } from "./fleet";

interface Props {
  vehicle: Vehicle;
  restoring: boolean;
  onRestore: () => void;
}

/** The vehicle's current gains next to its safe gains. */
export function SafeGains({ vehicle, restoring, onRestore }: Props) {
  const [entered, setEntered] = useState<Record<string, number>>();
  const status = useVehicleStatus(vehicle.id);
  const { safe_gains: safe } = vehicle;
  const held = inOrder(heldGains(vehicle, status), Object.keys(safe));
  const isCurrent = status?.isCurrent ?? false;
  const isKnown = Object.keys(held).length > 0;
  const mayRestore = vehicle.actions.includes("restore");
  if (entered) return <SafeGainsForm vehicle={vehicle} entered={entered} onDone={() => setEntered(undefined)} />;
  return (
    <Panel title="Gains">
      <Stack gap={14}>
        <table className={`${table["table"]} ${classes["table"]}`}>
          <thead>
            <tr>
              <th scope="col">Gain</th>
              <th scope="col" data-number>
                Current
              </th>
              <th scope="col" data-number>
                Safe <HelpTip topic="safeGains" />
              </th>
            </tr>
          </thead>
          <tbody className="numbers">
            {Object.entries(safe).map(([name, value]) => (
              <tr key={name}>
                <th scope="row">{name}</th>
                <td data-number>{held[name] === undefined ? NOTHING : gainText(held[name])}</td>
                <td data-number>{gainText(value)}</td>
              </tr>
            ))}
          </tbody>
        </table>
        {isKnown && sameHeld(held, safe) && (
          <span className={classes["good"]}>
            <IconCircleCheck size={18} aria-hidden />{" "}
            {isCurrent ? "Current gains are the safe gains" : "Safe gains at the last reading"}
          </span>
        )}
        {isKnown && !sameHeld(held, safe) && (
          <span className={classes["bad"]}>
            <IconAlertTriangle size={18} aria-hidden />{" "}
            {isCurrent
              ? "Current gains differ from the safe gains"
              : "Gains differed from the safe gains at the last reading"}
          </span>
        )}
        <Note>
          {isKnown ? (
            <>
              Read back <Time at={vehicle.held_at} />.
            </>
          ) : (
            unknownGainsText(vehicle, status)
          )}{" "}
          {isKnown && !sameHeld(held, safe) ? safeGainsWritten(vehicle) : RESTORED}
          {mayRestore && isArmed(status) && " They can be restored on request once its motors have stopped."}
        </Note>
        <Group gap={10}>
          <Button variant="default" disabled={!mayRestore || isArmed(status)} loading={restoring} onClick={onRestore}>
            Restore safe gains
          </Button>
          {isKnown && !sameHeld(held, safe) && (
            <Button variant="default" disabled={!vehicle.actions.includes("edit")} onClick={() => setEntered(held)}>
              Set current gains as safe gains
            </Button>
          )}
          <Button variant="subtle" disabled={!vehicle.actions.includes("edit")} onClick={() => setEntered(safe)}>
            Change safe gains
          </Button>
        </Group>
      </Stack>
    </Panel>
  );
}

interface FormProps {
  vehicle: Vehicle;
  /** Initial values of the fields. */
  entered: Record<string, number>;
  onDone: () => void;
}

const DECIDED_BY = "Decided by, and why";

function SafeGainsForm({ vehicle, entered, onDone }: FormProps) {
  const [gains, setGains] = useState<Record<string, NumberEntry>>({ ...vehicle.safe_gains, ...entered });
  const [statement, setStatement] = useState("");
  const edit = useEditVehicle(vehicle.id);
  const labels = {
    ...Object.fromEntries(Object.keys(gains).map((name) => [`safe_gains.${name}`, name])),
    statement: DECIDED_BY,
  };
  const reasons = reasonsByField(problemOf(edit.error), Object.keys(labels));
  const read = Object.entries(gains).filter((entry): entry is [string, number] => typeof entry[1] === "number");
  return (
    <Panel title="Change safe gains">
      <form
        className={classes["stack"]}
        onSubmit={(event) => {
          event.preventDefault();
          edit.mutate(
            { version: vehicle.version, safe_gains: Object.fromEntries(read), statement: statement.trim() || null },
            { onSuccess: onDone },
          );
        }}
      >
        <div className={classes["entries"]}>
          {Object.keys(vehicle.safe_gains).map((name) => (
            <NumberField
              key={name}
              required
              withAsterisk={false}
              label={name}
              value={gains[name] ?? ""}
              error={reasons[`safe_gains.${name}`]}
              onChange={(value) => setGains({ ...gains, [name]: value })}
            />
          ))}
        </div>
        <TextInput
          label={DECIDED_BY}
          value={statement}
          maxLength={500}
          error={reasons["statement"]}
          onChange={(event) => setStatement(event.currentTarget.value)}
        />
        <FormErrorNotice error={edit.error} labels={labels} />
        <Group gap={10}>
          <Button
            type="submit"
            disabled={read.length < Object.keys(gains).length || statement.trim() === ""}
            loading={edit.isPending}
          >
            Save safe gains
          </Button>
          <Button variant="default" onClick={onDone}>
            Cancel
          </Button>
        </Group>
      </form>
    </Panel>
  );
}
