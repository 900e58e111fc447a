import { Button, Switch } from "@mantine/core";
import { IconCopy } from "@tabler/icons-react";
import { useState } from "react";
import { useNavigate } from "react-router";
import { useClone } from "../api/mutations";
import { useCatalogue } from "../api/queries";
import type { Campaign } from "../api/types";
import { useVehicles } from "../api/vehicles";
import { kindsFor, registeredFor } from "../lib/newCampaign";
import { Choice } from "./Choice";
import { Help } from "./Help";
import classes from "./NextFlight.module.css";
import { Trouble } from "./Trouble";

/** The same settings again, on this vehicle or another, from the start or from what this campaign has reached. */
export function CloneForm({ campaign }: { campaign: Campaign }) {
  const navigate = useNavigate();
  const own = campaign.vehicle.registered ? String(campaign.vehicle.id) : campaign.vehicle.kind;
  const [vehicle, setVehicle] = useState(own);
  const [warm, setWarm] = useState(false);
  const clone = useClone(campaign.id);
  const catalogue = useCatalogue().data;
  const experiment = campaign.definition.experiment ?? "takeoff";
  const registered = registeredFor(useVehicles().data ?? [], experiment);
  const kinds = catalogue === undefined ? [] : kindsFor(catalogue, experiment);
  const chosen = registered.find(({ id }) => String(id) === vehicle);
  const choice = chosen === undefined ? { kind: vehicle } : { kind: chosen.kind, id: chosen.id };
  return (
    <div className={classes["clone"]}>
      <Choice
        label="Same settings again, on"
        data={[
          ...registered.map(({ id, name }) => ({ value: String(id), label: name })),
          ...kinds.map(({ name, title }) => ({ value: name, label: title })),
        ]}
        value={vehicle}
        onChange={setVehicle}
      />
      {campaign.best !== null && (
        <div className={classes["warm"]}>
          <Switch
            size="md"
            label={`Start from flight ${campaign.best.trial_number}`}
            checked={warm}
            onChange={(event) => setWarm(event.currentTarget.checked)}
          />
          <Help question="What is a warm start?">
            <p>
              The first flight uses this campaign's best gains. From how it goes the program sees whether the two
              vehicles are alike: then it builds on what was learned here, with a shorter first step; else it starts
              afresh.
            </p>
          </Help>
        </div>
      )}
      <Button
        leftSection={<IconCopy size={20} aria-hidden />}
        loading={clone.isPending}
        onClick={() =>
          // The same vehicle keeps its settings, another one starts from its own defaults.
          clone.mutate(
            { warmStart: warm, ...(vehicle === own ? {} : { vehicle: choice }) },
            { onSuccess: ({ id }) => void navigate(`/campaigns/${id}`) },
          )
        }
      >
        Clone
      </Button>
      <Trouble error={clone.error} />
    </div>
  );
}
