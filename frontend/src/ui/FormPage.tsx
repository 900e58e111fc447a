import { Box, SimpleGrid, Skeleton, Stack, Text, Title, UnstyledButton } from "@mantine/core";
import type { GetInputPropsReturnType, UseFormReturnType } from "@mantine/form";
import { IconChevronDown } from "@tabler/icons-react";
import type { UseMutationResult } from "@tanstack/react-query";
import { type ReactNode, useState } from "react";
import { flushSync } from "react-dom";
import { formProblem, problemOf, reasonsByField } from "../api/problems";
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
    <Box maw={860} mx="auto" style={{ containerType: "inline-size" }}>
      <Title order={1} mt={4} mb={16}>
        {title}
      </Title>
      {children}
      <ErrorNotice error={error} />
      {isPending && <Skeleton height={420} radius="md" aria-busy="true" />}
    </Box>
  );
}

interface RequestFormProps<Values, Request, Answer> {
  form: UseFormReturnType<Values, Request>;
  /** Labels of the fields, by the names that the form and the server have for them. */
  labels: Readonly<Record<string, string>>;
  request: UseMutationResult<Answer, Error, Request>;
  onDone: (answer: Answer) => void;
  /** The buttons, below the notice. */
  actions: ReactNode;
  children: ReactNode;
}

/** A form that is sent as one request. Reasons of a refusal stand at their fields until these are edited; the first of
 * them gets the focus. */
export function RequestForm<Values, Request, Answer>({
  form,
  labels,
  request,
  onDone,
  actions,
  children,
}: RequestFormProps<Values, Request, Answer>) {
  const fields = Object.keys(labels);
  const refuse = (error: Error): void => {
    flushSync(() => form.setErrors(reasonsByField(problemOf(error), fields)));
    document.querySelector<HTMLElement>('main [aria-invalid="true"]')?.focus();
  };
  return (
    <form noValidate onSubmit={form.onSubmit((sent) => request.mutate(sent, { onSuccess: onDone, onError: refuse }))}>
      <Stack gap={18}>
        {children}
        <ErrorNotice error={formProblem(request.error, labels, form.errors)} shown={fields} />
        {actions}
      </Stack>
    </form>
  );
}

/** What blocks the form, beside its button: texts that are missing, and fields without a valid number. */
export function MissingEntries({ numbers, texts = [] }: { numbers: readonly string[]; texts?: readonly string[] }) {
  if (numbers.length + texts.length === 0) return null;
  return (
    <p role="status">
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
      <Box hidden={!isOpen} p="5px 16px 16px">
        {children}
      </Box>
    </div>
  );
}

function outOfRange(value: NumberEntry, { lower, upper }: Gain): string | undefined {
  const isInside = typeof value !== "number" || (lower <= value && value <= upper);
  return isInside ? undefined : `Enter a number from ${lower} to ${upper}.`;
}

interface GainFieldsProps {
  legend: string;
  gains: readonly Gain[];
  /** Props of a gain's input, by the gain's name. */
  input: (name: string) => GetInputPropsReturnType;
}

/** A required number for each gain, with its range. */
export function GainFields({ legend, gains, input }: GainFieldsProps) {
  return (
    <fieldset>
      <Text component="legend" fw={550} mb={4}>
        {legend}
      </Text>
      <SimpleGrid minColWidth={120} autoFlow="auto-fit" spacing={12}>
        {gains.map((gain) => {
          const { value = "", onChange, error, ...props } = input(gain.name);
          return (
            <NumberField
              key={gain.name}
              required
              withAsterisk={false}
              label={gain.name}
              description={`${gain.lower} … ${gain.upper}${unitAfter(gain.unit)}`}
              whole={gain.integer}
              value={value}
              error={error ?? outOfRange(value, gain)}
              onChange={onChange}
              {...props}
            />
          );
        })}
      </SimpleGrid>
    </fieldset>
  );
}
