import { Box, Skeleton, Title, UnstyledButton } from "@mantine/core";
import { IconChevronDown } from "@tabler/icons-react";
import { type ReactNode, useState } from "react";
import type { Gain } from "../api/types";
import { type NumberEntry, NumberField } from "./Fields";
import classes from "./Form.module.css";
import { unitAfter } from "./format";
import { ErrorNotice } from "./Notices";

interface Props {
  title: string;
  error: unknown;
  isPending: boolean;
  children: ReactNode;
}

/** A page with one form, while what the form needs is loaded, and after. */
export function FormPage({ title, error, isPending, children }: Props) {
  return (
    <Box maw={860} mx="auto">
      <Title order={1} mt={4} mb={16}>
        {title}
      </Title>
      {children}
      <ErrorNotice error={error} />
      {isPending && <Skeleton height={420} radius="md" aria-busy="true" />}
    </Box>
  );
}

/** What blocks the form, beside its button: texts that are missing, and fields without a valid number. */
export function MissingEntries({ numbers, texts = [] }: { numbers: readonly string[]; texts?: readonly string[] }) {
  if (numbers.length + texts.length === 0) return null;
  return (
    <p role="status" className={classes["missing"]}>
      {[...texts, ...(numbers.length > 0 ? [`Enter a valid number for ${numbers.join(", ")}.`] : [])].join(" ")}
    </p>
  );
}

interface FoldedSectionProps {
  title: string;
  /** Whether it must be open, because it contains a refused field. */
  forcedOpen: boolean;
  children: ReactNode;
}

/** The part of a form that has defaults, collapsed at first. */
export function FoldedSection({ title, forcedOpen, children }: FoldedSectionProps) {
  const [isOpened, setOpened] = useState(false);
  const isOpen = forcedOpen || isOpened;
  return (
    <div className={classes["folded"]}>
      <UnstyledButton aria-expanded={isOpen} onClick={() => setOpened(!isOpen)}>
        <IconChevronDown size={18} aria-hidden />
        {title}
      </UnstyledButton>
      <div hidden={!isOpen}>{children}</div>
    </div>
  );
}

function outOfRange(value: NumberEntry | undefined, lower: number, upper: number): string | undefined {
  const isInside = typeof value !== "number" || (lower <= value && value <= upper);
  return isInside ? undefined : `Enter a number from ${lower} to ${upper}.`;
}

interface GainFieldsProps {
  legend: string;
  gains: readonly Gain[];
  values: Readonly<Record<string, NumberEntry>>;
  /** Refusals by field name, which is `prefix` and the gain's name. */
  reasons: Readonly<Record<string, string>>;
  prefix: string;
  onChange: (values: Record<string, NumberEntry>) => void;
}

/** A required number for each gain, with its range. */
export function GainFields({ legend, gains, values, reasons, prefix, onChange }: GainFieldsProps) {
  return (
    <fieldset className={classes["gains"]}>
      <legend>{legend}</legend>
      {gains.map(({ name, lower, upper, unit, integer }) => (
        <NumberField
          key={name}
          required
          withAsterisk={false}
          label={name}
          description={`${lower} … ${upper}${unitAfter(unit)}`}
          value={values[name] ?? ""}
          whole={integer}
          error={reasons[`${prefix}.${name}`] ?? outOfRange(values[name], lower, upper)}
          onChange={(value) => onChange({ ...values, [name]: value })}
        />
      ))}
    </fieldset>
  );
}
