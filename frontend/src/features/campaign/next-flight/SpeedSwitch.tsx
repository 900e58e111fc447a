import { Group, SegmentedControl } from "@mantine/core";
import { SPEEDS } from "./speed";

export function SpeedSwitch({ value, onChange }: { value: string; onChange: (value: string) => void }) {
  return (
    <Group justify="space-between" wrap="nowrap" gap={12} c="dimmed" fz="small">
      <span id="speed-label">Simulation speed</span>
      <SegmentedControl
        aria-labelledby="speed-label"
        size="md"
        flex="none"
        value={value}
        onChange={onChange}
        data={SPEEDS.map(({ value: name, label }) => ({ value: name, label }))}
      />
    </Group>
  );
}
