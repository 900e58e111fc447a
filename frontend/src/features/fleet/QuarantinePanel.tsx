import { Button, type ButtonProps, Group, Stack, Text, TextInput, Title } from "@mantine/core";
import { IconAlertOctagonFilled, IconArrowBarToDown } from "@tabler/icons-react";
import { useState } from "react";
import { useReadOnlyReason } from "../../api/access";
import { useRelease } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { useVehicleCommands, type VehicleCommand } from "../../api/vehicleCommands";
import { useVehicleStatus } from "../../live/store";
import { type Aged, isArmed, isDisarmed } from "../../live/vehicleStatus";
import { ErrorNotice } from "../../ui/Notices";
import { SlideToConfirm } from "../../ui/SlideToConfirm";
import classes from "./Fleet.module.css";

/** Reason of the quarantine, the remaining commands, and the release. */
export function QuarantinePanel({ vehicle }: { vehicle: Vehicle }) {
  const [statement, setStatement] = useState("");
  const status = useVehicleStatus(vehicle.id);
  const orders = useVehicleCommands(vehicle.id);
  const release = useRelease(vehicle.id);
  const watching = useReadOnlyReason(vehicle) !== null;
  const isDown = isDisarmed(status);
  return (
    <Stack gap={14} className={classes["quarantine"]}>
      <div role="alert">
        <Title order={2} display="flex" c="var(--bad)" fz="title" mb={6}>
          <IconAlertOctagonFilled size={24} aria-hidden />
          &nbsp;Quarantined: do not fly
        </Title>
        <Text lh={1.45}>{vehicle.concern}</Text>
      </div>
      <Text lh={1.45}>
        {isArmed(status)
          ? "It cannot be flown; Land and Motors off are still available, Check now and Restore safe gains once its motors have stopped."
          : "It cannot be flown; Land, Motors off, Check now and Restore safe gains are still available."}{" "}
        {isDown
          ? "Inspect it, then release it."
          : "Land it, make sure that its motors have stopped, inspect it, then release it."}
      </Text>
      <Group gap={10} align="flex-end">
        <LandNow isDown={isDown} orders={orders} flex="1 1 260px" />
        <MotorsOff vehicle={vehicle} status={status} orders={orders} watching={watching} />
      </Group>
      <form action={() => release.mutate(statement.trim())}>
        <Group gap={10} align="flex-end">
          <TextInput
            label="Inspected by, and findings"
            flex="1 1 260px"
            value={statement}
            maxLength={500}
            onChange={(event) => setStatement(event.currentTarget.value)}
          />
          <Button type="submit" variant="default" disabled={statement.trim() === ""} loading={release.isPending}>
            Release vehicle
          </Button>
        </Group>
      </form>
      <ErrorNotice error={release.error} />
    </Stack>
  );
}

interface LandProps {
  /** Whether the vehicle reports that its motors are off. */
  isDown: boolean;
  orders: ReturnType<typeof useVehicleCommands>;
}

/** The Land command; not the main button for a vehicle that is down. */
export function LandNow({ isDown, orders, flex }: LandProps & Pick<ButtonProps, "flex">) {
  return (
    <Button
      size="lg"
      flex={flex}
      {...(isDown ? { variant: "default" } : { color: "red" })}
      leftSection={<IconArrowBarToDown size={22} aria-hidden />}
      onClick={() => orders.press("land")}
    >
      Land now
    </Button>
  );
}

interface Props {
  vehicle: Vehicle;
  status: Aged | null;
  orders: ReturnType<typeof useVehicleCommands>;
  /** Whether this browser has read-only access, which disables the control. */
  watching: boolean;
}

/** Emergency stop of the motors, separate from other controls. */
export function MotorsOff({ vehicle, status, orders, watching }: Props) {
  const asked = vehicle.actions.includes("motors off") || status?.status.armed === true;
  const enabled = asked && !watching;
  return (
    <Group gap="8px 14px" className={classes["motorsOff"] ?? ""}>
      <SlideToConfirm
        label="Motors off – the drone falls"
        meaning="Stops the motors at any altitude."
        disabled={!enabled}
        onConfirm={() => orders.press("motors off")}
      />
      <CommandResult orders={orders} isDown={isDisarmed(status)} />
    </Group>
  );
}

const COMMANDS: Record<VehicleCommand, string> = { land: "Land", "motors off": "Motors off" };

/** Result of the last command, as an alert; once the motors are off, that they are. */
export function CommandResult({ orders: { said }, isDown }: LandProps) {
  if (said === null) return null;
  const { accepted, order, sentence } = said;
  const confirmed = isDown ? "The motors are off." : sentence;
  return (
    <Text flex={1} miw={160} fz="small" lh={1.35} role="alert" {...(!accepted && { c: "var(--bad)", fw: 650 })}>
      {accepted ? confirmed : `${COMMANDS[order]} not confirmed. ${sentence}`}
    </Text>
  );
}
