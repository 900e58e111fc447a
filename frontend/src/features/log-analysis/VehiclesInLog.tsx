import { Chip, Group, Text } from "@mantine/core";
import classes from "./LogAnalysis.module.css";

interface Props {
  /** Autopilots by system id. */
  vehicles: Readonly<Record<string, string>>;
  analysed: number;
  /** Null: it needs the log's file. */
  onVehicle: ((system: number) => void) | null;
}

/** The vehicles in a log, to analyse another one. */
export function VehiclesInLog({ vehicles, analysed, onVehicle }: Props) {
  return (
    <Chip.Group value={String(analysed)} onChange={(chosen) => onVehicle?.(Number(chosen))}>
      <Group gap="8px 10px" mt={10} role="radiogroup" aria-label="Vehicle">
        <Text component="span">Vehicles in this log:</Text>
        {Object.entries(vehicles).map(([system, autopilot]) => (
          <Chip
            key={system}
            value={system}
            variant="outline"
            disabled={onVehicle === null}
            classNames={{ label: classes["chip"] }}
          >
            System {system}, {autopilot}
          </Chip>
        ))}
      </Group>
    </Chip.Group>
  );
}
