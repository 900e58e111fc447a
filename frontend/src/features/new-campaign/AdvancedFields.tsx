import { SegmentedControl, SimpleGrid, Stack, Text } from "@mantine/core";
import type { UseFormReturnType } from "@mantine/form";
import { useMediaQuery } from "@mantine/hooks";
import type { ReactNode } from "react";
import type { Catalogue, NewCampaign } from "../../api/types";
import { NumberField, OptionField, ShareField } from "../../ui/Fields";
import { Note } from "../../ui/Note";
import { boundReasons, type NumberInfo, numbersFor, type OptionGroup, optionsFor } from "./fields";
import classes from "./NewCampaign.module.css";
import { type CampaignForm, gainsOf, type StopKind } from "./newCampaign";

type Form = UseFormReturnType<CampaignForm, NewCampaign>;

interface Props {
  form: Form;
  catalogue: Catalogue;
}

const STOPS: Record<StopKind, { label: string; line: string }> = {
  noise: {
    label: "No resolvable improvement",
    line: "Ends when no further step is predicted to give a resolvable improvement, and the best and first gains have been flown again.",
  },
  paper: {
    label: "No improvement",
    line: "Ends after two consecutive flights that improve on the best by less than the threshold, as in the paper.",
  },
  budget: { label: "Flight budget", line: "Ends after the maximum number of flights." },
};

/** The first stop rule for a strategy that proposes no steps. */
const BY_HAND =
  "Ends when the best and first gains have been flown again and one of them is better. The last two flights are reserved for that.";

/** Optional settings with defaults. */
export function AdvancedFields({ form, catalogue }: Props) {
  const narrow = useMediaQuery("(max-width: 620px)", false, { getInitialValueInEffect: false });
  const { strategy, stop } = form.values.definition;
  const numbers = numbersFor(form.values, catalogue);
  const options = optionsFor(form.values, catalogue);
  const inputs = (infos: readonly NumberInfo[]) =>
    infos.map(({ path, label, isShare, input }) => {
      const Field = isShare ? ShareField : NumberField;
      return <Field key={path} label={label} {...input} {...form.getInputProps(path)} />;
    });
  return (
    <Stack gap={22}>
      <Group title="Stop rule">
        <SegmentedControl
          aria-label="Stop rule"
          size="md"
          className={classes["wide"]}
          orientation={narrow ? "vertical" : "horizontal"}
          data={Object.entries(STOPS).map(([value, { label }]) => ({ value, label }))}
          {...form.getInputProps("definition.stop.kind", { withError: false })}
        />
        <Note fz="small" className={classes["wide"]}>
          {stop.kind === "noise" && strategy === "manual" ? BY_HAND : STOPS[stop.kind].line}
        </Note>
        {inputs(numbers.stop)}
      </Group>
      <Options group={options.strategy} form={form} />
      <Options group={options.experiment} form={form} />
      <Group title="Bounds and steps">
        <BoundFields form={form} catalogue={catalogue} />
        {inputs(numbers.steps)}
      </Group>
      <Options group={options.vehicle} form={form} />
      {numbers.seed.length > 0 && <Group title="Random seed">{inputs(numbers.seed)}</Group>}
    </Stack>
  );
}

function Group({ title, children }: { title: string; children: ReactNode }) {
  return (
    <fieldset>
      <Text component="legend" fw={650} mb={6}>
        {title}
      </Text>
      <SimpleGrid minColWidth={230} spacing={16} verticalSpacing={12} style={{ alignItems: "start" }}>
        {children}
      </SimpleGrid>
    </fieldset>
  );
}

function Options({ group: { path, title, options }, form }: { group: OptionGroup; form: Form }) {
  if (options.length === 0) return null;
  return (
    <Group title={title}>
      {options.map((option) => (
        <OptionField key={option.name} option={option} {...form.getInputProps(`${path}.${option.name}`)} />
      ))}
    </Group>
  );
}

function BoundFields({ form, catalogue }: Props) {
  const { experiment, bounds } = form.values.definition;
  return gainsOf(catalogue, experiment).map((gain) => {
    const path = `definition.bounds.${gain.name}`;
    const pair = bounds[gain.name] ?? [gain.lower, gain.upper];
    const reasons = boundReasons(gain, pair, form.errors[path]);
    return (
      <SimpleGrid key={gain.name} cols={2} spacing={8} verticalSpacing={4} style={{ alignItems: "start" }}>
        <span className={classes["wide"]}>
          <strong>{gain.name}</strong>
          <Text component="small" display="block">
            {[gain.title, gain.unit].filter((part) => part !== "" && part !== "1").join(", ")}
          </Text>
        </span>
        {(["Minimum", "Maximum"] as const).map((label, place) => (
          <NumberField
            key={label}
            label={label}
            aria-label={`${gain.name} ${label.toLowerCase()}`}
            whole={gain.integer}
            value={pair[place] ?? ""}
            error={reasons[place]}
            onChange={(value) => form.setFieldValue(path, pair.with(place, value))}
          />
        ))}
      </SimpleGrid>
    );
  });
}
