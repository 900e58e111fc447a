import { SegmentedControl, Switch } from "@mantine/core";
import type { ReactNode } from "react";
import type { Catalogue } from "../api/types";
import { type CampaignForm, gainsOf, type OptionValue, type StopKind } from "../lib/newCampaign";
import classes from "./AdvancedFields.module.css";
import { Entry } from "./Entry";

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

/** Settings that have a good default each. */
export function AdvancedFields(props: Props) {
  return (
    <div className={classes["all"]}>
      <StopFields {...props} />
      <StrategyOptions {...props} />
      <BoundFields {...props} />
      <VehicleOptions {...props} />
      <Group title="Chance">
        <Entry
          label="Seed"
          description="The same seed gives the same scatter"
          value={props.form.seed}
          error={props.reasons["seed"]}
          onChange={(seed) => props.set({ seed })}
        />
      </Group>
    </div>
  );
}

function StopFields({ form, reasons, set }: Props) {
  return (
    <Group title="Stop">
      <SegmentedControl
        aria-label="Stop rule"
        size="md"
        className={classes["wide"]}
        value={form.stop}
        onChange={(value) => set({ stop: value as StopKind })}
        data={[
          { value: "paper", label: "When it stops improving" },
          { value: "budget", label: "After all flights" },
        ]}
      />
      <Entry
        label="Flights at most"
        value={form.maxFlights}
        error={reasons["stop.max_flights"]}
        onChange={(maxFlights) => set({ maxFlights })}
      />
      {form.stop === "paper" && (
        <Entry
          label="An improvement is at least"
          suffix=" %"
          value={form.improvementPercent}
          error={reasons["stop.improvement"]}
          onChange={(improvementPercent) => set({ improvementPercent })}
        />
      )}
    </Group>
  );
}

function StrategyOptions({ form, catalogue, set }: Props) {
  const strategy = catalogue.strategies.find(({ name }) => name === form.strategy);
  if (!strategy || strategy.options.length === 0) return null;
  const choose = (name: string, value: OptionValue): void =>
    set({ strategyOptions: { ...form.strategyOptions, [name]: value } });
  return (
    <Group title={`Strategy: ${strategy.title}`}>
      {strategy.options.map((option) => (
        <Switch
          key={option.name}
          size="md"
          className={classes["wide"]}
          label={option.title}
          checked={(form.strategyOptions[option.name] ?? option.default) === true}
          onChange={(event) => choose(option.name, event.currentTarget.checked)}
        />
      ))}
    </Group>
  );
}

function BoundFields({ form, catalogue, reasons, set }: Props) {
  return (
    <Group title="Bounds and steps">
      {gainsOf(catalogue).map((gain) => {
        const [low, high] = form.bounds[gain.name] ?? [gain.lower, gain.upper];
        const change = (pair: [number | string, number | string]): void =>
          set({ bounds: { ...form.bounds, [gain.name]: pair } });
        return (
          <div key={gain.name} className={classes["bounds"]}>
            <Entry label={`${gain.name} at least`} value={low} onChange={(value) => change([value, high])} />
            <Entry
              label={`${gain.name} at most`}
              value={high}
              error={reasons[`bounds.${gain.name}`]}
              onChange={(value) => change([low, value])}
            />
          </div>
        );
      })}
      <Entry
        label="First step at most"
        description="of each range, until a flight is valid"
        suffix=" %"
        value={form.firstStepPercent}
        error={reasons["first_step_fraction"]}
        onChange={(firstStepPercent) => set({ firstStepPercent })}
      />
      <Entry
        label="Later steps at most"
        description="of each range"
        suffix=" %"
        value={form.stepPercent}
        error={reasons["step_fraction"]}
        onChange={(stepPercent) => set({ stepPercent })}
      />
    </Group>
  );
}

function VehicleOptions({ form, catalogue, reasons, set }: Props) {
  const kind = catalogue.vehicle_kinds.find(({ name }) => name === form.vehicle);
  if (!kind || kind.options.length === 0) return null;
  const choose = (name: string, value: OptionValue): void =>
    set({ vehicleOptions: { ...form.vehicleOptions, [name]: value } });
  return (
    <Group title={`Vehicle: ${kind.title}`}>
      {kind.options.map((option) => (
        <Entry
          key={option.name}
          label={option.title}
          description={option.lower === null ? undefined : `${option.lower} … ${option.upper} ${option.unit}`}
          value={Number(form.vehicleOptions[option.name] ?? option.default)}
          error={reasons[`vehicle.options.${option.name}`]}
          onChange={(value) => choose(option.name, value === "" ? option.default : Number(value))}
        />
      ))}
    </Group>
  );
}
