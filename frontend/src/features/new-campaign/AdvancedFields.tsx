import { SegmentedControl, Stack } from "@mantine/core";
import { useMediaQuery } from "@mantine/hooks";
import type { ReactNode } from "react";
import type { Catalogue, OptionInfo } from "../../api/types";
import { NumberField, OptionField, type OptionValue } from "../../ui/Fields";
import { unitsOf } from "../../ui/units";
import classes from "./NewCampaign.module.css";
import {
  ADVANCED_LABELS,
  boundReasons,
  type CampaignForm,
  gainsOf,
  hasModel,
  isSeeded,
  optionsOf,
  type StopKind,
} from "./newCampaign";

interface Props {
  form: CampaignForm;
  catalogue: Catalogue;
  reasons: Record<string, string>;
  set: (change: Partial<CampaignForm>) => void;
}

function Group({ title, children }: { title: string; children: ReactNode }) {
  return (
    <fieldset className={classes["group"]}>
      <legend>{title}</legend>
      <div className={classes["fields"]}>{children}</div>
    </fieldset>
  );
}

/** Optional settings with defaults. */
export function AdvancedFields(props: Props) {
  const { form, catalogue, reasons, set } = props;
  const options = optionsOf(form, catalogue);
  const titled = (things: readonly { name: string; title: string }[], name: string): string =>
    things.find((thing) => thing.name === name)?.title ?? name;
  return (
    <Stack gap={22}>
      <StopFields {...props} />
      <OptionGroup
        title={`Strategy: ${titled(catalogue.strategies, form.strategy)}`}
        options={options.strategy}
        chosen={form.strategyOptions}
        reasons={reasons}
        prefix="definition.options"
        onChange={(strategyOptions) => set({ strategyOptions })}
      />
      <OptionGroup
        title={`Experiment: ${titled(catalogue.experiments, form.experiment)}`}
        options={options.experiment}
        chosen={form.experimentOptions}
        reasons={reasons}
        prefix="experiment_options"
        onChange={(experimentOptions) => set({ experimentOptions })}
      />
      <BoundFields {...props} />
      <OptionGroup
        title={`Vehicle: ${titled(catalogue.vehicle_kinds, form.vehicle)}`}
        options={options.vehicle}
        chosen={form.vehicleOptions}
        reasons={reasons}
        prefix="vehicle.options"
        onChange={(vehicleOptions) => set({ vehicleOptions })}
      />
      {isSeeded(form, catalogue) && (
        <Group title="Random seed">
          <NumberField
            label={ADVANCED_LABELS.seed}
            whole
            description="The same seed reproduces the same scatter"
            value={form.seed}
            error={reasons["seed"]}
            onChange={(seed) => set({ seed })}
          />
        </Group>
      )}
    </Stack>
  );
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

function StopFields({ form, catalogue, reasons, set }: Props) {
  const narrow = useMediaQuery("(max-width: 620px)", false, { getInitialValueInEffect: false });
  return (
    <Group title="Stop rule">
      <SegmentedControl
        aria-label="Stop rule"
        size="md"
        className={classes["wide"]}
        orientation={narrow ? "vertical" : "horizontal"}
        value={form.stop}
        onChange={(value) => set({ stop: value as StopKind })}
        data={Object.entries(STOPS).map(([value, { label }]) => ({ value, label }))}
      />
      <p className={classes["note"]}>
        {form.stop === "noise" && form.strategy === "manual" ? BY_HAND : STOPS[form.stop].line}
      </p>
      <NumberField
        label={ADVANCED_LABELS["stop.max_flights"]}
        whole
        value={form.maxFlights}
        error={reasons["stop.max_flights"]}
        onChange={(maxFlights) => set({ maxFlights })}
      />
      {form.stop === "paper" && (
        <NumberField
          label={ADVANCED_LABELS["stop.improvement"]}
          suffix=" %"
          value={form.improvementPercent}
          error={reasons["stop.improvement"]}
          onChange={(improvementPercent) => set({ improvementPercent })}
        />
      )}
      {form.stop === "noise" && (
        <NumberField
          label={ADVANCED_LABELS["stop.confidence"]}
          suffix=" %"
          value={form.confidencePercent}
          error={reasons["stop.confidence"]}
          onChange={(confidencePercent) => set({ confidencePercent })}
        />
      )}
      {unitsOf(catalogue, form.experiment).output === "m" && (
        <NumberField
          label={ADVANCED_LABELS["stop.min_battery_v"]}
          placeholder="No limit"
          suffix=" V"
          value={form.minBatteryV}
          error={reasons["stop.min_battery_v"]}
          onChange={(minBatteryV) => set({ minBatteryV })}
        />
      )}
    </Group>
  );
}

interface OptionsProps {
  title: string;
  options: readonly OptionInfo[];
  chosen: Record<string, OptionValue>;
  reasons: Record<string, string>;
  prefix: string;
  onChange: (chosen: Record<string, OptionValue>) => void;
}

function OptionGroup({ title, options, chosen, reasons, prefix, onChange }: OptionsProps) {
  if (options.length === 0) return null;
  return (
    <Group title={title}>
      {options.map((option) => (
        <OptionField
          key={option.name}
          option={option}
          value={chosen[option.name]}
          error={reasons[`${prefix}.${option.name}`]}
          onChange={(value) => onChange({ ...chosen, [option.name]: value })}
        />
      ))}
    </Group>
  );
}

function BoundFields({ form, catalogue, reasons, set }: Props) {
  return (
    <Group title="Bounds and steps">
      {gainsOf(catalogue, form.experiment).map((gain) => {
        const [low, high] = form.bounds[gain.name] ?? [gain.lower, gain.upper];
        const change = (pair: [number | string, number | string]): void =>
          set({ bounds: { ...form.bounds, [gain.name]: pair } });
        const [lowReason, highReason] = boundReasons(gain, [low, high], reasons[`bounds.${gain.name}`]);
        return (
          <div key={gain.name} className={classes["bounds"]}>
            <span className={classes["gain"]}>
              <strong>{gain.name}</strong>
              <small>{[gain.title, gain.unit].filter((part) => part !== "" && part !== "1").join(", ")}</small>
            </span>
            <NumberField
              label="Minimum"
              aria-label={`${gain.name} minimum`}
              value={low}
              whole={gain.integer}
              error={lowReason}
              onChange={(value) => change([value, high])}
            />
            <NumberField
              label="Maximum"
              aria-label={`${gain.name} maximum`}
              value={high}
              whole={gain.integer}
              error={highReason}
              onChange={(value) => change([low, value])}
            />
          </div>
        );
      })}
      <NumberField
        label={ADVANCED_LABELS.first_step_fraction}
        description="Fraction of each gain's range, until the first valid flight"
        suffix=" %"
        value={form.firstStepPercent}
        error={reasons["first_step_fraction"]}
        onChange={(firstStepPercent) => set({ firstStepPercent })}
      />
      <NumberField
        label={ADVANCED_LABELS.step_fraction}
        description="Fraction of each gain's range, after that"
        suffix=" %"
        value={form.stepPercent}
        error={reasons["step_fraction"]}
        onChange={(stepPercent) => set({ stepPercent })}
      />
      {hasModel(catalogue, form.experiment) && unitsOf(catalogue, form.experiment).output === "m" && (
        <NumberField
          label={ADVANCED_LABELS.ceiling_m}
          description="Gains that could take the vehicle above this altitude are refused"
          suffix=" m"
          value={form.ceilingM}
          error={reasons["ceiling_m"]}
          onChange={(ceilingM) => set({ ceilingM })}
        />
      )}
    </Group>
  );
}
