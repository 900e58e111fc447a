import { Checkbox, InputBase, type InputBaseProps, TextInput, type TextInputProps } from "@mantine/core";
import { IconChevronDown } from "@tabler/icons-react";
import { useState } from "react";
import type { OptionInfo } from "../api/types";
import { readNumber, stopped, typed, unitAfter } from "./format";

/** A number, or text that is not a number yet. */
export type NumberEntry = number | string;

interface Props extends Omit<TextInputProps, "value" | "onChange"> {
  value: NumberEntry;
  onChange: (value: NumberEntry) => void;
  suffix?: string;
  /** Value of an empty field; without it the field must be filled. */
  empty?: number;
  /** Whether only whole numbers are valid. */
  whole?: boolean;
}

/** Number input. Passes on valid input as a number and anything else as text, with an error message. */
export function NumberField({
  value,
  onChange,
  suffix,
  empty,
  error,
  required = false,
  whole = false,
  ...props
}: Props) {
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
      rightSection={suffix?.trim()}
      onChange={(event) => {
        setText(event.currentTarget.value);
        onChange(meant(event.currentTarget.value));
      }}
      {...props}
    />
  );
}

export type OptionValue = boolean | number | string;

interface OptionFieldProps {
  option: OptionInfo;
  value: OptionValue | undefined;
  error: string | undefined;
  onChange: (value: OptionValue) => void;
}

function rangeOf({ lower = null, upper = null, unit = "" }: OptionInfo): string | undefined {
  const after = unitAfter(unit);
  if (lower === null && upper === null) return after.trim() || undefined;
  return `${lower ?? "…"} … ${upper ?? ""}${after}`.trim();
}

const CHOICES: Readonly<Record<string, string>> = { mocap: "Motion capture" };

function shown(choice: OptionValue): string {
  return CHOICES[String(choice)] ?? String(choice).replace(/^./, (letter) => letter.toUpperCase());
}

/** Input for an option, by its type: checkbox, select, text, or number with its range. */
export function OptionField({ option, value, error, onChange }: OptionFieldProps) {
  const { title, default: standard, choices = [] } = option;
  const now = value ?? standard;
  if (typeof standard === "boolean") {
    return (
      <Checkbox
        size="md"
        label={title}
        checked={now === true}
        error={error}
        onChange={(event) => onChange(event.currentTarget.checked)}
      />
    );
  }
  if (choices.length > 0) {
    return (
      <SelectField
        label={title}
        data={choices.map((choice) => ({ value: String(choice), label: shown(choice) }))}
        value={String(now)}
        error={error}
        onChange={(chosen) => onChange(choices.find((choice) => String(choice) === chosen) ?? standard)}
      />
    );
  }
  if (typeof standard === "string") {
    return (
      <TextInput
        label={title}
        value={String(now)}
        error={error}
        autoCapitalize="off"
        spellCheck={false}
        onChange={(event) => onChange(event.currentTarget.value)}
      />
    );
  }
  return (
    <NumberField
      label={title}
      description={rangeOf(option)}
      value={typeof now === "boolean" ? "" : now}
      error={error}
      onChange={onChange}
      empty={standard}
    />
  );
}

interface Option<Value extends string = string> {
  value: Value;
  label: string;
}

interface SelectFieldProps<Value extends string> extends InputBaseProps {
  "aria-label"?: string;
  data: readonly Option<Value>[];
  value: Value;
  onChange: (value: Value) => void;
}

/** Native select: large on touch screens, and accessible to screen readers. */
export function SelectField<Value extends string>({ data, onChange, ...props }: SelectFieldProps<Value>) {
  return (
    <InputBase
      component="select"
      pointer
      rightSection={<IconChevronDown size={18} aria-hidden />}
      rightSectionPointerEvents="none"
      inputWrapperOrder={["label", "input", "description", "error"]}
      onChange={(event) => {
        const chosen = data.find(({ value }) => value === event.currentTarget.value);
        if (chosen !== undefined) onChange(chosen.value);
      }}
      {...props}
    >
      {data.map(({ value, label }) => (
        <option key={value} value={value}>
          {label}
        </option>
      ))}
    </InputBase>
  );
}
