import { Switch, TextInput } from "@mantine/core";
import type { OptionInfo } from "../api/types";
import { NumberField } from "./NumberField";
import { SelectField } from "./SelectField";

export type OptionValue = boolean | number | string;

interface Props {
  option: OptionInfo;
  value: OptionValue | undefined;
  error: string | undefined;
  onChange: (value: OptionValue) => void;
}

function rangeOf({ lower = null, upper = null, unit = "" }: OptionInfo): string | undefined {
  if (lower === null && upper === null) return unit === "" ? undefined : unit;
  return `${lower ?? "…"} … ${upper ?? ""} ${unit}`.trim();
}

function shown(choice: OptionValue): string {
  return String(choice).replace(/^./, (letter) => letter.toUpperCase());
}

/** Input for an option, by its type: switch, select, text, or number with its range. */
export function OptionField({ option, value, error, onChange }: Props) {
  const { title, default: standard, choices = [] } = option;
  const now = value ?? standard;
  if (typeof standard === "boolean") {
    return (
      <Switch
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
