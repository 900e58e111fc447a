import type { GainInfo } from "../api/types";
import classes from "./Form.module.css";
import { type NumberEntry, NumberField } from "./NumberField";

interface Props {
  legend: string;
  gains: readonly GainInfo[];
  values: Readonly<Record<string, NumberEntry>>;
  /** Refusals by field name, which is `prefix` and the gain's name. */
  reasons: Readonly<Record<string, string>>;
  prefix: string;
  onChange: (values: Record<string, NumberEntry>) => void;
}

/** A required number for each gain, with its range. */
export function GainFields({ legend, gains, values, reasons, prefix, onChange }: Props) {
  return (
    <fieldset className={classes["gains"]}>
      <legend>{legend}</legend>
      {gains.map(({ name, lower, upper, unit }) => (
        <NumberField
          key={name}
          required
          withAsterisk={false}
          label={name}
          description={`${lower} … ${upper} ${unit}`}
          value={values[name] ?? ""}
          error={reasons[`${prefix}.${name}`]}
          onChange={(value) => onChange({ ...values, [name]: value })}
        />
      ))}
    </fieldset>
  );
}
