import { InputBase, type InputBaseProps } from "@mantine/core";
import { IconChevronDown } from "@tabler/icons-react";

interface Option<Value extends string = string> {
  value: Value;
  label: string;
}

interface Props<Value extends string> extends InputBaseProps {
  "aria-label"?: string;
  data: readonly Option<Value>[];
  value: Value;
  onChange: (value: Value) => void;
}

/** Native select: large on touch screens, and accessible to screen readers. */
export function SelectField<Value extends string>({ data, onChange, ...props }: Props<Value>) {
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
