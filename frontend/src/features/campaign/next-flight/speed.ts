/** The speed at which a simulation flies. */

import { useLocalStorage } from "@mantine/hooks";

/** Simulated time over wall time; null: as fast as possible. */
export type Speed = 1 | 10 | null;

export const SPEEDS: readonly { value: string; label: string; speed: Speed }[] = [
  { value: "1", label: "1×", speed: 1 },
  { value: "10", label: "10×", speed: 10 },
  { value: "max", label: "Max", speed: null },
];

export function speedOf(value: string): Speed {
  const found = SPEEDS.find((one) => one.value === value);
  return found === undefined ? 10 : found.speed;
}

/** The selected simulation speed, stored on this device. */
export function useSpeed(): [string, (value: string) => void] {
  const [value, setValue] = useLocalStorage({
    key: "gainline-speed",
    defaultValue: "10",
    getInitialValueInEffect: false,
  });
  return [value, setValue];
}
