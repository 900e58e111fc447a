/** Preferences of this browser; stored locally only. */

import { useLocalStorage } from "@mantine/hooks";

const kept = { getInitialValueInEffect: false } as const;

/** Operator name used to take control of vehicles. */
export function useOperatorName() {
  return useLocalStorage({ ...kept, key: "gainline-operator", defaultValue: "" });
}

/** Whether flight events are spoken. */
export function useSpeechWanted() {
  return useLocalStorage({ ...kept, key: "gainline-speech", defaultValue: false });
}
