import { Button } from "@mantine/core";
import { useState } from "react";
import { navigate } from "wouter/use-browser-location";
import { useStartCampaign } from "../../api/logAnalyses";
import type { RecordFiles } from "../../api/records";
import { useVehicles } from "../../api/vehicles";
import { SelectField } from "../../ui/Fields";
import { ErrorNotice } from "../../ui/Notices";

interface Props {
  logId: number;
  /** Null: what is stored of the log suffices. */
  files: RecordFiles | null;
  experiment: string | null;
  /** System id of the one analysed, if the log has several. */
  loggedVehicle: number | null;
}

/** Starts a campaign with the takeoffs of the log as its first flights, or with the gains proposed from it. */
export function StartCampaign({ logId, files, experiment, loggedVehicle }: Props) {
  const { mutate, error, isPending } = useStartCampaign();
  const [chosen, setChosen] = useState("");
  const flying = (useVehicles().data ?? []).filter(
    ({ registered, experiments }) => registered && experiments.includes(experiment ?? ""),
  );
  const isOpen = flying.length > 1 && chosen === "";
  return (
    <>
      {flying.length > 1 && (
        <SelectField
          aria-label="Vehicle of the log"
          data={[
            { value: "", label: "Vehicle of the log…" },
            ...flying.map(({ id, name }) => ({ value: String(id), label: name })),
          ]}
          value={chosen}
          onChange={setChosen}
        />
      )}
      <Button
        loading={isPending}
        disabled={isOpen}
        onClick={() =>
          mutate(
            { logId, files, vehicle: chosen === "" ? null : Number(chosen), loggedVehicle },
            { onSuccess: ({ id }) => navigate(`/campaigns/${id}`) },
          )
        }
      >
        Start campaign
      </Button>
      <ErrorNotice error={error} />
    </>
  );
}
