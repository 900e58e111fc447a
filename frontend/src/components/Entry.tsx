import { NumberInput, type NumberInputProps } from "@mantine/core";
import type { Entry as Value } from "../lib/newCampaign";

interface Props extends Omit<NumberInputProps, "value" | "onChange"> {
  value: Value;
  onChange: (value: Value) => void;
}

/** A number to type: it takes what is written, the server says whether it can be used. */
export function Entry(props: Props) {
  return <NumberInput hideControls inputMode="decimal" {...props} />;
}
