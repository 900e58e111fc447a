import { Button, NumberInput } from "@mantine/core";
import { useState } from "react";
import { useCreateTrial } from "../api/mutations";
import { useCatalogue } from "../api/queries";
import type { Campaign } from "../api/types";
import type { Speed } from "../lib/nextStep";
import { problemOf, reasonsByField } from "../lib/problems";
import classes from "./NextFlight.module.css";
import { Trouble } from "./Trouble";

interface Props {
  campaign: Campaign;
  start: Record<string, number>;
  speed: Speed;
  onClose: () => void;
}

/** The operator's own gains, through the same checks as proposed ones. */
export function ManualGains({ campaign, start, speed, onClose }: Props) {
  const [values, setValues] = useState<Record<string, number | string>>(start);
  const create = useCreateTrial(campaign.id);
  const experiment = useCatalogue().data?.experiments.find(({ name }) => name === campaign.definition.experiment);
  const names = Object.keys(start);
  const reasons = reasonsByField(problemOf(create.error), names);
  function submit(): void {
    const gains = Object.fromEntries(
      Object.entries(values).flatMap(([name, value]) => (value === "" ? [] : [[name, Number(value)]])),
    );
    create.mutate({ gains, ...(campaign.vehicle.can_fly ? { fly: { speed } } : {}) }, { onSuccess: onClose });
  }
  return (
    <form
      className={classes["stack"]}
      noValidate
      onSubmit={(event) => {
        event.preventDefault();
        submit();
      }}
    >
      {names.map((name) => {
        const gain = experiment?.gains.find((one) => one.name === name);
        return (
          <NumberInput
            key={name}
            label={`${name}${gain ? ` · ${gain.title}` : ""}`}
            description={gain && `${gain.lower} … ${gain.upper} ${gain.unit}`}
            value={values[name] ?? ""}
            onChange={(value) => setValues({ ...values, [name]: value })}
            error={reasons[name]}
            {...(gain ? { step: Math.max(1, Math.round(gain.scale / 10)) } : {})}
          />
        );
      })}
      <Button type="submit" size="lg" loading={create.isPending}>
        {campaign.vehicle.can_fly ? "Fly these gains" : "Plan these gains"}
      </Button>
      <Button variant="default" onClick={onClose}>
        Back to the proposal
      </Button>
      <Trouble error={create.error} shown={names} />
    </form>
  );
}
