import { Button, TextInput } from "@mantine/core";
import { IconUserCheck } from "@tabler/icons-react";
import { useHandOver, useTakeControl } from "../../api/control";
import type { Vehicle } from "../../api/types";
import { useOwnLease } from "../../live/leases";
import { Trouble } from "../Trouble";
import { useOperatorName } from "../usePreferences";
import classes from "./Fly.module.css";

/** Whether this tab is in control of the vehicle, as far as it knows. */
export function useIsInControl(vehicle: Vehicle): boolean {
  const own = useOwnLease(vehicle.id);
  return own !== null && (vehicle.control === null || vehicle.control.operator === own.operator);
}

/** One operator at a time: take control by name, see who has it, take over where everybody sees it. */
export function Control({ vehicle }: { vehicle: Vehicle }) {
  const [name, setName] = useOperatorName();
  const isOwn = useIsInControl(vehicle);
  const own = useOwnLease(vehicle.id);
  const take = useTakeControl(vehicle.id);
  const handOver = useHandOver(vehicle.id);
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
        <Trouble error={handOver.error} />
      </div>
    );
  }
  const other = vehicle.control?.operator ?? null;
  return (
    <form
      className={classes["stack"]}
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
      <Trouble error={take.error} />
    </form>
  );
}
