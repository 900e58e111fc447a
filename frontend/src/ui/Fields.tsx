import { Checkbox, NativeSelect, type NativeSelectProps, TextInput, type TextInputProps } from "@mantine/core";
import { IconChevronDown } from "@tabler/icons-react";
import { useState } from "react";
import { inPercent } from "../api/problems";
import type { OptionInfo } from "../api/types";
import { readNumber, stopped, typed, unitAfter } from "./format";

/** A number, or text that is not a number yet. */
export type NumberEntry = number | string;

export interface NumberFieldProps extends Omit<TextInputProps, "value" | "onChange"> {
  value?: NumberEntry;
  onChange: (value: NumberEntry) => void;
  /** Value of an empty field; without it the field must be filled. */
  empty?: number;
  /** Whether only whole numbers are valid. */
  whole?: boolean;
}

/** Number input. Passes on valid input as a number and anything else as text, with an error message. */
export function NumberField({
  value = "",
  onChange,
  empty,
  error,
  required = false,
  whole = false,
  ...props
}: NumberFieldProps) {
  const written = typeof value === "number" ? typed(value) : value;
  const [text, setText] = useState(written);
  const meant = (typing: string): NumberEntry =>
    typing.trim() === "" ? (empty ?? "") : (readNumber(typing, whole).value ?? typing);
  const shown = meant(text) === value ? text : written;
  const wrong = shown.trim() === "" && !required ? undefined : readNumber(shown, whole).reason;
  return (
    <TextInput
      inputMode="decimal"
      autoComplete="off"
      placeholder={empty === undefined ? undefined : typed(empty)}
      value={shown}
      error={wrong ?? (typeof error === "string" ? stopped(error) : error)}
      onChange={(event) => {
        setText(event.currentTarget.value);
        onChange(meant(event.currentTarget.value));
      }}
      {...props}
    />
  );
}

/** The entry times a factor, if it is a number. */
export function scaled(entry: NumberEntry, factor: number): NumberEntry {
  return typeof entry === "number" ? Number((factor * entry).toPrecision(12)) : entry;
}

/** Input of a share in percent. */
export function ShareField({ value = "", onChange, error, ...props }: NumberFieldProps) {
  return (
    <NumberField
      rightSection="%"
      value={scaled(value, 100)}
      error={typeof error === "string" ? inPercent(error) : error}
      onChange={(percent) => onChange(scaled(percent, 0.01))}
      {...props}
    />
  );
}

/** The entries that are numbers. */
export function numbersOf(entries: Readonly<Record<string, NumberEntry>>): Record<string, number> {
  return Object.fromEntries(
    Object.entries(entries).filter((entry): entry is [string, number] => typeof entry[1] === "number"),
  );
}

export type OptionValue = boolean | number | string;

interface OptionFieldProps {
  option: OptionInfo;
  value?: OptionValue;
  error?: TextInputProps["error"];
  onChange: (value: OptionValue) => void;
}

function rangeOf({ lower, upper, unit }: OptionInfo): string | undefined {
  const after = unitAfter(unit);
  if (lower === null && upper === null) return after.trim() || undefined;
  return `${lower ?? "…"} … ${upper ?? ""}${after}`.trim();
}

const CHOICES: Readonly<Record<string, string>> = { mocap: "Motion capture" };

/** Input for an option, by its type: checkbox, select, text, or number with its range. */
export function OptionField({ option, value, onChange, ...props }: OptionFieldProps) {
  const { title, default: standard, choices } = option;
  const field = { label: title, ...props };
  const now = value ?? standard;
  if (typeof standard === "boolean") {
    return (
      <Checkbox
        size="md"
        checked={now === true}
        onChange={(event) => onChange(event.currentTarget.checked)}
        {...field}
      />
    );
  }
  if (choices.length > 0) {
    const data = choices.map(String).map((choice) => ({
      value: choice,
      label: CHOICES[choice] ?? choice.replace(/^./, (letter) => letter.toUpperCase()),
    }));
    return (
      <SelectField
        data={data}
        value={String(now)}
        onChange={(chosen) => onChange(choices.find((choice) => String(choice) === chosen) ?? standard)}
        {...field}
      />
    );
  }
  if (typeof standard === "string") {
    return (
      <TextInput
        value={String(now)}
        autoCapitalize="off"
        spellCheck={false}
        onChange={(event) => onChange(event.currentTarget.value)}
        {...field}
      />
    );
  }
  return (
    <NumberField
      description={rangeOf(option)}
      value={typeof now === "boolean" ? "" : now}
      onChange={onChange}
      empty={standard}
      {...field}
    />
  );
}

interface SelectFieldProps<Value extends string> extends Omit<NativeSelectProps, "data" | "value" | "onChange"> {
  data: readonly { value: Value; label: string }[];
  value?: NoInfer<Value>;
  onChange: (value: Value) => void;
}

/** Native select: large on touch screens, and accessible to screen readers. */
export function SelectField<Value extends string>({ onChange, ...props }: SelectFieldProps<Value>) {
  return (
    <NativeSelect
      rightSection={<IconChevronDown size={18} aria-hidden />}
      inputWrapperOrder={["label", "input", "description", "error"]}
      onChange={({ currentTarget }) => onChange(currentTarget.value as Value)}
      {...props}
    />
  );
}
