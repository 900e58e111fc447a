/** What a person has chosen for this browser; it stays here, and no server hears of it. */

import { useLocalStorage } from "@mantine/hooks";

const kept = { getInitialValueInEffect: false } as const;

/** The name that one takes control of vehicles with. */
export function useOperatorName() {
  return useLocalStorage({ ...kept, key: "gainline-operator", defaultValue: "" });
}

/** Whether the browser speaks of flights. */
export function useSpeechWanted() {
  return useLocalStorage({ ...kept, key: "gainline-speech", defaultValue: false });
}
