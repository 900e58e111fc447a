import { Button, TextInput } from "@mantine/core";
import { IconUserCheck } from "@tabler/icons-react";
import { useReleaseControl, useTakeControl } from "../../api/control";
import { useOwnLease } from "../../api/leases";
import type { Vehicle } from "../../api/types";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { useOperatorName } from "../../ui/usePreferences";
import classes from "./OperatorControl.module.css";

/** Whether this tab is in control of the vehicle, as far as it knows. */
export function useIsInControl(vehicle: Vehicle): boolean {
  const own = useOwnLease(vehicle.id);
  return own !== null && (vehicle.control === null || vehicle.control.operator === own.operator);
}

/** One operator at a time: take control by name, see who has it, take over where everybody sees it. */
export function OperatorControl({ vehicle }: { vehicle: Vehicle }) {
  const [name, setName] = useOperatorName();
  const isOwn = useIsInControl(vehicle);
  const own = useOwnLease(vehicle.id);
  const take = useTakeControl(vehicle.id);
  const handOver = useReleaseControl(vehicle.id);
  if (isOwn) {
    return (
      <div className={classes["control"]}>
        <span className={classes["inControl"]}>
          <IconUserCheck size={20} aria-hidden />
          <span>
            <strong>{own?.operator}</strong>, you are in control
          </span>
        </span>
        <Button
          variant="subtle"
          color="gray"
          c="var(--dim)"
          px="xs"
          loading={handOver.isPending}
          onClick={() => handOver.mutate()}
        >
          Hand over
        </Button>
        <ErrorNotice error={handOver.error} />
      </div>
    );
  }
  const other = vehicle.control?.operator ?? null;
  return (
    <form
      className={classes["form"]}
      onSubmit={(event) => {
        event.preventDefault();
        take.mutate({ operator: name.trim(), takeOver: other !== null });
      }}
    >
      {other !== null && (
        <p className={classes["say"]}>
          <strong>{other} is in control.</strong> Ask for it to be handed over, or take over: everybody sees that.
        </p>
      )}
      <div className={classes["take"]}>
        <TextInput
          label="Your name"
          value={name}
          maxLength={80}
          autoComplete="name"
          onChange={(event) => setName(event.currentTarget.value)}
        />
        <Button
          type="submit"
          variant={other === null ? "filled" : "outline"}
          color={other === null ? "petrol" : "red"}
          disabled={name.trim() === ""}
          loading={take.isPending}
        >
          {other === null ? "Take control" : "Take over"}
        </Button>
      </div>
      <ErrorNotice error={take.error} />
    </form>
  );
}
