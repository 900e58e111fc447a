import { Button, Group, SimpleGrid, Stack, TextInput } from "@mantine/core";
import { useForm } from "@mantine/form";
import { useState } from "react";
import { useEditVehicle } from "../../api/fleet";
import type { Vehicle, VehicleEdit } from "../../api/types";
import { useVehicleStatus } from "../../live/store";
import { heldGains, isArmed } from "../../live/vehicleStatus";
import { NumberField, numbersOf } from "../../ui/Fields";
import { RequestForm } from "../../ui/FormPage";
import { gainText, NOTHING } from "../../ui/format";
import { inOrder, RESTORED, safeGainsWritten, sameHeld } from "../../ui/gains";
import { ListTable } from "../../ui/ListTable";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { unknownGainsText, unreadGains, type VehicleForm } from "./fleet";
import { type ButtonRequest, CheckResult } from "./VehicleReadings";

interface Props {
  vehicle: Vehicle;
  /** Props of the button that restores them. */
  restore: ButtonRequest;
}

/** The current gains against the safe gains, while data comes from the vehicle and after. */
const SAFE = ["Current gains are the safe gains", "Safe gains at the last reading"];
const DIFFERENT = [
  "Current gains differ from the safe gains",
  "Gains differed from the safe gains at the last reading",
];

/** The vehicle's current gains next to its safe gains. */
export function SafeGains({ vehicle, restore }: Props) {
  const [entered, setEntered] = useState<Record<string, number>>();
  const status = useVehicleStatus(vehicle.id);
  const { safe_gains: safe } = vehicle;
  const held = inOrder(heldGains(vehicle, status), Object.keys(safe));
  const isCurrent = status?.isCurrent ?? false;
  const isKnown = Object.keys(held).length > 0;
  const isSafe = sameHeld(held, safe);
  const [now, before] = isSafe ? SAFE : DIFFERENT;
  const mayRestore = vehicle.actions.includes("restore");
  if (entered) return <SafeGainsForm vehicle={vehicle} entered={entered} onDone={() => setEntered(undefined)} />;
  return (
    <Panel title="Gains">
      <Stack gap={14}>
        <ListTable
          label="Current and safe gains"
          className={classes["table"]}
          rows={Object.entries(safe)}
          keyOf={([name]) => name}
          columns={[
            { title: "Gain", isHeading: true, cell: ([name]) => name },
            { title: "Current", cell: ([name]) => (held[name] === undefined ? NOTHING : gainText(held[name])) },
            { title: "Safe", topic: "safeGains", cell: ([, value]) => gainText(value) },
          ]}
        />
        {isKnown && <CheckResult passed={isSafe}>{isCurrent ? now : before}</CheckResult>}
        <Note>
          {isKnown ? (
            <>
              Read back <Time at={vehicle.held_at} />.
            </>
          ) : (
            unknownGainsText(vehicle, status)
          )}{" "}
          {isKnown && !isSafe ? safeGainsWritten(vehicle) : RESTORED}
          {mayRestore && isArmed(status) && " They can be restored on request once its motors have stopped."}
        </Note>
        <Group gap={10}>
          <Button variant="default" disabled={!mayRestore || isArmed(status)} {...restore}>
            Restore safe gains
          </Button>
          {isKnown && !isSafe && (
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
  const { id, version, safe_gains: safe } = vehicle;
  const names = Object.keys(safe);
  const form = useForm<Pick<VehicleForm, "safe_gains" | "statement">, VehicleEdit>({
    initialValues: { safe_gains: { ...safe, ...entered }, statement: "" },
    transformValues: ({ safe_gains, statement }) => ({
      version,
      safe_gains: numbersOf(safe_gains),
      statement: statement.trim() || null,
    }),
  });
  const edit = useEditVehicle(id);
  return (
    <Panel title="Change safe gains">
      <RequestForm
        form={form}
        labels={{
          ...Object.fromEntries(names.map((name) => [`safe_gains.${name}`, name])),
          statement: DECIDED_BY,
        }}
        request={edit}
        onDone={onDone}
        actions={
          <Group gap={10}>
            <Button
              type="submit"
              disabled={unreadGains(form.values).length > 0 || form.values.statement.trim() === ""}
              loading={edit.isPending}
            >
              Save safe gains
            </Button>
            <Button variant="default" onClick={onDone}>
              Cancel
            </Button>
          </Group>
        }
      >
        <SimpleGrid minColWidth={110} autoFlow="auto-fit" spacing={12}>
          {names.map((name) => (
            <NumberField
              key={name}
              required
              withAsterisk={false}
              label={name}
              {...form.getInputProps(`safe_gains.${name}`)}
            />
          ))}
        </SimpleGrid>
        <TextInput label={DECIDED_BY} maxLength={500} {...form.getInputProps("statement")} />
      </RequestForm>
    </Panel>
  );
}
