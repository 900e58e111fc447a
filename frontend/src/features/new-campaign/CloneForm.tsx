import { Button, Checkbox, Group, Stack } from "@mantine/core";
import { IconCopy } from "@tabler/icons-react";
import { useState } from "react";
import { useClone } from "../../api/mutations";
import { useCatalogue } from "../../api/queries";
import type { Campaign } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import { SelectField } from "../../ui/Fields";
import { HelpTip } from "../../ui/HelpTip";
import { ErrorNotice } from "../../ui/Notices";
import { choicesOf, kindsFor, openCampaign, registeredFor } from "./newCampaign";

interface Props extends Pick<Campaign, "id" | "vehicle"> {
  experiment: string;
  /** Number of the best flight with the best gains. */
  bestFlight: number | null;
}

/** Clone with the same settings, on this vehicle or another, from the start gains or this campaign's best. */
export function CloneForm({ id: origin, vehicle: own, bestFlight, experiment }: Props) {
  const ownKey = own.registered ? String(own.id) : own.kind;
  const [vehicle, setVehicle] = useState(ownKey);
  const [warm, setWarm] = useState(false);
  const clone = useClone(origin);
  const catalogue = useCatalogue().data;
  const registered = registeredFor(useVehicles().data ?? [], experiment);
  const kinds = catalogue === undefined ? [] : kindsFor(catalogue, experiment);
  const chosen = registered.find(({ id }) => String(id) === vehicle);
  const choice = chosen === undefined ? { kind: vehicle } : { kind: chosen.kind, id: chosen.id };
  return (
    <Stack gap={8}>
      <SelectField
        label="Clone to vehicle"
        data={[...registered.map(({ id, name }) => ({ value: String(id), label: name })), ...choicesOf(kinds)]}
        value={vehicle}
        onChange={setVehicle}
      />
      {bestFlight !== null && (
        <Group gap={8} mih={48}>
          <Checkbox
            size="md"
            label={`Start from flight ${bestFlight}`}
            checked={warm}
            onChange={(event) => setWarm(event.currentTarget.checked)}
          />
          <HelpTip topic="warmStart" />
        </Group>
      )}
      <Button
        variant="default"
        leftSection={<IconCopy size={20} aria-hidden />}
        loading={clone.isPending}
        onClick={() =>
          // The same vehicle keeps its settings, another one starts from its own defaults.
          clone.mutate(
            { warm_start: warm, vehicle: vehicle === ownKey ? undefined : choice },
            { onSuccess: openCampaign },
          )
        }
      >
        Clone
      </Button>
      <ErrorNotice error={clone.error} />
    </Stack>
  );
}
