import { TextInput } from "@mantine/core";
import type { Catalogue } from "../../api/types";
import { OptionField, type OptionValue } from "../../ui/Fields";
import classes from "../../ui/Form.module.css";
import { FoldedSection } from "../../ui/FormPage";
import { autopilotOf, furtherOptions } from "./fleet";

export const PLAIN_LABELS = { name: "Name", "options.address": "Address" };

interface FieldProps<Value> {
  value: Value;
  error: string | undefined;
  onChange: (value: string) => void;
}

export function NameField({ value, error, onChange }: FieldProps<string>) {
  return (
    <TextInput
      label={PLAIN_LABELS.name}
      description="Shown on every page, for example the number on the airframe"
      value={value}
      maxLength={120}
      error={error}
      onChange={(event) => onChange(event.currentTarget.value)}
    />
  );
}

export function AddressField({ value, error, onChange }: FieldProps<OptionValue | undefined>) {
  return (
    <TextInput
      label={PLAIN_LABELS["options.address"]}
      description="udp:HOST:PORT@LOCALPORT (the vehicle sends to LOCALPORT of this computer), udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"
      inputWrapperOrder={["label", "input", "description", "error"]}
      value={String(value ?? "")}
      error={error}
      autoCapitalize="off"
      spellCheck={false}
      onChange={(event) => onChange(event.currentTarget.value)}
    />
  );
}

interface FurtherProps {
  catalogue: Catalogue;
  options: Readonly<Record<string, OptionValue>>;
  reasons: Readonly<Record<string, string>>;
  onChange: (name: string, value: OptionValue) => void;
}

/** The options that have defaults, collapsed unless one of them is refused. */
export function FurtherFields({ catalogue, options, reasons, onChange }: FurtherProps) {
  const refused = Object.keys(furtherLabels(catalogue)).some((field) => reasons[field] !== undefined);
  return (
    <FoldedSection title="Advanced: identity, limits, motion capture, signing" forcedOpen={refused}>
      <div className={classes["pair"]}>
        {furtherOptions(catalogue, autopilotOf({ options })).map((option) => (
          <OptionField
            key={option.name}
            option={option}
            value={options[option.name]}
            error={reasons[`options.${option.name}`]}
            onChange={(value) => onChange(option.name, value)}
          />
        ))}
      </div>
    </FoldedSection>
  );
}

/** Titles of these options by field. */
export function furtherLabels(catalogue: Catalogue): Record<string, string> {
  return Object.fromEntries(
    furtherOptions(catalogue).map(({ name, title, label }) => [`options.${name}`, label || title]),
  );
}
