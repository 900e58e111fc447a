import { Button, Select } from "@mantine/core";
import { IconArchive, IconCopy } from "@tabler/icons-react";
import { useState } from "react";
import { useNavigate } from "react-router";
import { useArchive, useClone } from "../api/mutations";
import { useCatalogue } from "../api/queries";
import type { Campaign, Trial } from "../api/types";
import { against, percentChange, withUnit } from "../lib/format";
import { bestOf } from "../lib/nextStep";
import { campaignWords } from "../lib/states";
import classes from "./NextFlight.module.css";
import { Panel } from "./Panel";
import { Trouble } from "./Trouble";

interface Props {
  campaign: Campaign;
  trials: readonly Trial[];
  onChoose: (trialNumber: number) => void;
}

/** The campaign's result, and what to do with it. */
export function FinishedCard({ campaign, trials, onChoose }: Props) {
  const navigate = useNavigate();
  const [vehicle, setVehicle] = useState(campaign.vehicle.kind);
  const clone = useClone(campaign.id);
  const archive = useArchive(campaign.id);
  const kinds = useCatalogue().data?.vehicle_kinds ?? [];
  const best = bestOf(campaign, trials);
  const first = trials.find((trial) => trial.state === "valid");
  const title = campaignWords("finished", campaign.outcome).word;
  const change = percentChange(best?.error, first?.error);
  return (
    <Panel title={title}>
      <div className={classes["stack"]}>
        {campaign.stop_reason?.toLowerCase() !== title.toLowerCase() && (
          <p className={classes["quiet"]}>{campaign.stop_reason}</p>
        )}
        {best !== null && (
          <div className={`${classes["best"]} numbers`}>
            <p>Best: flight {best.number}</p>
            <p className={classes["figure"]}>{withUnit(best.error, "m")}</p>
            <p>
              {Object.entries(best.gains)
                .map(([name, value]) => `${name} ${value}`)
                .join("  ·  ")}
            </p>
            {first && change !== null && best.id !== first.id && (
              <p>
                {against(change, `flight ${first.number}`)} ({withUnit(first.error, "m")})
              </p>
            )}
          </div>
        )}
        {best !== null && (
          <Button variant="default" onClick={() => onChoose(best.number)}>
            Look at flight {best.number}
          </Button>
        )}
        <div className={classes["clone"]}>
          <Select
            label="Same settings again, on"
            allowDeselect={false}
            data={kinds.map(({ name, title }) => ({ value: name, label: title }))}
            value={vehicle}
            onChange={(kind) => setVehicle(kind ?? vehicle)}
          />
          <Button
            leftSection={<IconCopy size={20} aria-hidden />}
            loading={clone.isPending}
            onClick={() =>
              // The same vehicle keeps its settings, another one starts from its own defaults.
              clone.mutate(vehicle === campaign.vehicle.kind ? undefined : vehicle, {
                onSuccess: ({ id }) => void navigate(`/campaigns/${id}`),
              })
            }
          >
            Clone
          </Button>
        </div>
        {campaign.actions.includes("archive") && (
          <Button
            variant="subtle"
            color="gray"
            c="var(--dim)"
            leftSection={<IconArchive size={18} aria-hidden />}
            loading={archive.isPending}
            onClick={() => archive.mutate()}
          >
            Archive
          </Button>
        )}
        <Trouble error={clone.error ?? archive.error} />
      </div>
    </Panel>
  );
}
