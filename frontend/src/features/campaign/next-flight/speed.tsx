/** The speed at which a simulation flies, selected once for this device. */

import { Group, SegmentedControl } from "@mantine/core";
import { useLocalStorage } from "@mantine/hooks";

const SPEEDS = [
  { value: "1", label: "1×", speed: 1 },
  { value: "10", label: "10×", speed: 10 },
  { value: "max", label: "Max", speed: null },
];

export function speedOf(value: string): number | null {
  const found = SPEEDS.find((one) => one.value === value);
  return found === undefined ? 10 : found.speed;
}

function useSelected() {
  return useLocalStorage({ key: "gainline-speed", defaultValue: "10", getInitialValueInEffect: false });
}

/** Simulated time over wall time; null: as fast as possible. */
export function useSpeed(): number | null {
  return speedOf(useSelected()[0]);
}

export function SpeedSwitch() {
  const [value, select] = useSelected();
  return (
    <Group justify="space-between" wrap="nowrap" gap={12} c="dimmed" fz="small">
      <span id="speed-label">Simulation speed</span>
      <SegmentedControl
        aria-labelledby="speed-label"
        size="md"
        flex="none"
        value={value}
        onChange={select}
        data={SPEEDS}
      />
    </Group>
  );
}
