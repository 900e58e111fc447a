import { TextInput, type TextInputProps } from "@mantine/core";
import { useState } from "react";
import { readNumber, typed } from "./numbers";

/** A number, or text that is not a number yet. */
export type NumberEntry = number | string;

interface Props extends Omit<TextInputProps, "value" | "onChange"> {
  value: NumberEntry;
  onChange: (value: NumberEntry) => void;
  suffix?: string;
  /** Value of an empty field; without it the field must be filled. */
  empty?: number;
}

/** Number input. Passes on valid input as a number and anything else as text, with an error message. */
export function NumberField({ value, onChange, suffix, empty, error, required = false, ...props }: Props) {
  const written = typeof value === "number" ? typed(value) : value;
  const [text, setText] = useState(written);
  const meant = (typing: string): NumberEntry =>
    typing.trim() === "" ? (empty ?? "") : (readNumber(typing).value ?? typing);
  const shown = meant(text) === value ? text : written;
  const wrong = shown.trim() === "" && !required ? undefined : readNumber(shown).reason;
  return (
    <TextInput
      inputMode="decimal"
      autoComplete="off"
      placeholder={empty === undefined ? undefined : typed(empty)}
      value={shown}
      error={wrong ?? error}
      rightSection={suffix?.trim()}
      onChange={(event) => {
        setText(event.currentTarget.value);
        onChange(meant(event.currentTarget.value));
      }}
      {...props}
    />
  );
}
