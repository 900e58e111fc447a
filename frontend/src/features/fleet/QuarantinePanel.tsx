import { Button, TextInput } from "@mantine/core";
import { IconAlertOctagonFilled, IconArrowBarToDown } from "@tabler/icons-react";
import { useState } from "react";
import { useReadOnlyReason } from "../../api/access";
import { useRelease } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { type CommandAnswer, useVehicleCommands, type VehicleCommand } from "../../api/vehicleCommands";
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
    <section className={classes["quarantine"]}>
      <div role="alert">
        <h2>
          <IconAlertOctagonFilled size={24} aria-hidden />
          Quarantined: do not fly
        </h2>
        <p>{vehicle.concern}</p>
      </div>
      <p>
        {isArmed(status)
          ? "It cannot be flown; Land and Motors off are still available, Check now and Restore safe gains once its motors have stopped."
          : "It cannot be flown; Land, Motors off, Check now and Restore safe gains are still available."}{" "}
        {isDown
          ? "Inspect it, then release it."
          : "Land it, make sure that its motors have stopped, inspect it, then release it."}
      </p>
      <div className={classes["row"]}>
        <LandNow isDown={isDown} orders={orders} />
        <MotorsOff vehicle={vehicle} status={status} orders={orders} watching={watching} />
      </div>
      <form
        className={classes["row"]}
        onSubmit={(event) => {
          event.preventDefault();
          release.mutate(statement.trim());
        }}
      >
        <TextInput
          label="Inspected by, and findings"
          value={statement}
          maxLength={500}
          onChange={(event) => setStatement(event.currentTarget.value)}
        />
        <Button type="submit" variant="default" disabled={statement.trim() === ""} loading={release.isPending}>
          Release vehicle
        </Button>
      </form>
      <ErrorNotice error={release.error} />
    </section>
  );
}

interface LandProps {
  /** Whether the vehicle reports that its motors are off. */
  isDown: boolean;
  orders: ReturnType<typeof useVehicleCommands>;
}

/** The Land command; not the main button for a vehicle that is down. */
export function LandNow({ isDown, orders }: LandProps) {
  return (
    <Button
      size="lg"
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
  watching?: boolean;
}

/** Emergency stop of the motors, separate from other controls. */
export function MotorsOff({ vehicle, status, orders, watching = false }: Props) {
  const asked = vehicle.actions.includes("motors off") || status?.status.armed === true;
  const enabled = asked && !watching;
  return (
    <div className={classes["motorsOff"]}>
      <SlideToConfirm
        label="Motors off – the drone falls"
        meaning="Stops the motors at any altitude."
        disabled={!enabled}
        onConfirm={() => orders.press("motors off")}
      />
      <CommandResult orders={orders} isDown={isDisarmed(status)} />
    </div>
  );
}

const COMMANDS: Record<VehicleCommand, string> = { land: "Land", "motors off": "Motors off" };

/** Result of the last command, as an alert. */
export function CommandResult({ orders: { said }, isDown }: LandProps) {
  if (said === null) return null;
  return (
    <p className={classes["said"]} data-bad={!said.accepted || undefined} role="alert">
      {commandText(said, isDown)}
    </p>
  );
}

/** The answer to the command; once the motors are off, that they are. */
function commandText({ accepted, order, sentence }: CommandAnswer, isDown: boolean): string {
  if (!accepted) return `${COMMANDS[order]} not confirmed. ${sentence}`;
  return isDown ? "The motors are off." : sentence;
}
