import { Anchor, Box, Button, Group, Input, SimpleGrid, Stack, Text } from "@mantine/core";
import type { ReactNode } from "react";
import { Link } from "wouter";
import type { Catalogue, Vehicle } from "../../api/types";
import { VehicleBadge } from "../../ui/Badges";
import { autopilotTitle } from "../fleet/fleet";
import { VehicleStateBadge } from "../fleet/VehicleStateBadge";
import classes from "./NewCampaign.module.css";
import { type CampaignForm, kindsFor, registeredFor, withRegistered, withVehicle } from "./newCampaign";

interface Props {
  form: CampaignForm;
  catalogue: Catalogue;
  vehicles: readonly Vehicle[];
  error: ReactNode;
  onChange: (form: CampaignForm) => void;
}

/** Selection of a registered vehicle or a shared simulation. A vehicle of another experiment changes the experiment. */
export function VehiclePicker({ form, catalogue, vehicles, error, onChange }: Props) {
  const { registered: chosen, vehicle, definition } = form;
  const fitting = registeredFor(vehicles, definition.experiment);
  const others = vehicles.filter((one) => one.registered && !fitting.includes(one));
  const choose = (one: Vehicle): void => onChange(withRegistered(form, catalogue, one));
  return (
    <div>
      <Input.Wrapper size="md" label="Vehicle" labelElement="div" error={error}>
        <SimpleGrid minColWidth={210} autoFlow="auto-fit" spacing={12} mt={6} role="radiogroup" aria-label="Vehicle">
          {fitting.map((one) => (
            <VehicleOption
              key={one.id}
              isReal={one.is_real}
              checked={one.id === chosen?.id}
              name={one.name}
              line={autopilotTitle(catalogue, one)}
              onChoose={() => choose(one)}
            >
              <VehicleStateBadge vehicle={one} />
            </VehicleOption>
          ))}
          {kindsFor(catalogue, definition.experiment).map(({ name, title, line, is_real }) => (
            <VehicleOption
              key={name}
              isReal={is_real}
              checked={chosen === null && name === vehicle.kind}
              name={title}
              line={line}
              onChoose={() => onChange(withVehicle(form, catalogue, name))}
            />
          ))}
        </SimpleGrid>
      </Input.Wrapper>
      <Group gap="4px 12px" mt={8}>
        {others.length > 0 && (
          <Text span c="dimmed">
            Vehicles that fly another experiment (choosing one changes it):
          </Text>
        )}
        {others.map((one) => (
          <Button key={one.id} variant="default" onClick={() => choose(one)}>
            {one.name}
          </Button>
        ))}
        <Anchor component={Link} to="/vehicles/new" lh="44px">
          Register a vehicle
        </Anchor>
      </Group>
    </div>
  );
}

interface OptionProps {
  isReal: boolean;
  checked: boolean;
  name: string;
  line: string;
  onChoose: () => void;
  children?: ReactNode;
}

function VehicleOption({ isReal, checked, name, line, onChoose, children }: OptionProps) {
  return (
    <Stack component="label" gap={6} mih={128} p="14px 16px" lh={1.35} className={classes["card"]}>
      <Group justify="space-between">
        <VehicleBadge isReal={isReal} />
        <Box component="input" type="radio" w={24} h={24} m={0} name="vehicle" checked={checked} onChange={onChoose} />
      </Group>
      <strong>{name}</strong>
      <Text span c="dimmed" fz="small" lh="inherit">
        {line}
      </Text>
      {children}
    </Stack>
  );
}
