import { Chip, Group, Text } from "@mantine/core";
import classes from "./LogAnalysis.module.css";

interface Props {
  /** Autopilots by system id. */
  vehicles: Readonly<Record<string, string>>;
  analysed: number;
  onVehicle: (system: number) => void;
}

/** The vehicles in a log, to analyse another one. */
export function LoggedVehicles({ vehicles, analysed, onVehicle }: Props) {
  return (
    <Chip.Group value={String(analysed)} onChange={(chosen) => onVehicle(Number(chosen))}>
      <Group gap="8px 10px" mt={10} role="radiogroup" aria-label="Vehicle">
        <Text component="span">Vehicles in this log:</Text>
        {Object.entries(vehicles).map(([system, autopilot]) => (
          <Chip key={system} value={system} variant="outline" classNames={{ label: classes["chip"] }}>
            System {system}, {autopilot}
          </Chip>
        ))}
      </Group>
    </Chip.Group>
  );
}
