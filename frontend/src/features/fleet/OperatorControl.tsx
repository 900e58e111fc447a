import { Button, Group, Stack, Text, TextInput } from "@mantine/core";
import { IconUserCheck } from "@tabler/icons-react";
import { useReleaseControl, useTakeControl } from "../../api/control";
import { useOwnLease } from "../../api/leases";
import type { Vehicle } from "../../api/types";
import { ErrorNotice } from "../../ui/Notices";
import { useOperatorName } from "../../ui/usePreferences";

/** Whether this tab has the vehicle's lease. */
export function useIsInControl(vehicle: Vehicle): boolean {
  const own = useOwnLease(vehicle.id);
  return own !== null && (vehicle.control === null || vehicle.control.operator === own.operator);
}

/** Take control of the vehicle, release it, or take it over from another operator. */
export function OperatorControl({ vehicle }: { vehicle: Vehicle }) {
  const [name, setName] = useOperatorName();
  const isOwn = useIsInControl(vehicle);
  const own = useOwnLease(vehicle.id);
  const take = useTakeControl(vehicle.id);
  const release = useReleaseControl(vehicle.id);
  if (isOwn) {
    return (
      <Group justify="space-between" gap="0 8px" fz="body">
        <Group gap={8} wrap="nowrap">
          <IconUserCheck size={20} color="var(--best)" aria-hidden />
          <span>
            <strong>{own?.operator}</strong>, you are in control
          </span>
        </Group>
        <Button
          variant="subtle"
          color="gray"
          c="var(--dim)"
          px="xs"
          loading={release.isPending}
          onClick={() => release.mutate()}
        >
          Release control
        </Button>
        <ErrorNotice error={release.error} />
      </Group>
    );
  }
  const other = vehicle.control?.operator ?? null;
  const isSameName = other === name.trim();
  return (
    <form action={() => take.mutate({ operator: name.trim(), takeOver: other !== null })}>
      <Stack gap={12}>
        {other !== null && (
          <Text lh={1.4}>
            <strong>
              {other} is in control{isSameName && ", in another tab or browser"}.
            </strong>{" "}
            {isSameName ? "Take over to continue here." : "Agree with them, then take over."} All users see the
            takeover.
          </Text>
        )}
        <Group gap={8} align="flex-end" wrap="nowrap">
          <TextInput
            label="Your name"
            flex={1}
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
        </Group>
        <ErrorNotice error={take.error} />
      </Stack>
    </form>
  );
}
