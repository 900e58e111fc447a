import { Select } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useState } from "react";
import { useCampaigns } from "../api/queries";
import type { CampaignSummary } from "../api/types";
import { plusMinus } from "../lib/uncertainty";
import classes from "./AdvancedFields.module.css";
import { GainList } from "./GainList";
import { useUnits } from "./useUnits";

interface Props {
  experiment: string;
  donor: CampaignSummary | null;
  error: string | undefined;
  onChange: (donor: CampaignSummary | null) => void;
}

/** The campaign whose best gains are flown first; found by its name. */
export function DonorPicker({ experiment, donor, error, onChange }: Props) {
  const [search, setSearch] = useState("");
  const [sought] = useDebouncedValue(search.trim(), 200);
  const unit = useUnits(experiment).error;
  const asked = donor !== null && sought === donor.name ? "" : sought;
  const found = useCampaigns({ search: asked, state: [], vehicle: [], sort: "-updated" });
  const usable = (found.data?.pages.flatMap((page) => page.items) ?? []).filter(
    (campaign) => campaign.best !== null && campaign.experiment === experiment,
  );
  const offered = donor === null || usable.some(({ id }) => id === donor.id) ? usable : [donor, ...usable];
  return (
    <div className={classes["donor"]}>
      <Select
        label="Campaign"
        placeholder="Search by name"
        searchable
        clearable
        nothingFoundMessage="No campaign with a valid flight has such a name"
        data={offered.map(({ id, name, vehicle }) => ({ value: String(id), label: `${name} · ${vehicle.title}` }))}
        filter={({ options }) => options}
        value={donor === null ? null : String(donor.id)}
        searchValue={search}
        onSearchChange={setSearch}
        error={error}
        onChange={(id) => onChange(offered.find((one) => String(one.id) === id) ?? null)}
      />
      {donor?.best && (
        <p className={`${classes["taken"]} numbers`}>
          Its best, flight {donor.best.trial_number} on {donor.vehicle.title}:{" "}
          <strong>
            <GainList gains={donor.best.gains} experiment={experiment} />
          </strong>
          , error {plusMinus(donor.best.mean, donor.best.standard_error, unit)} (± standard error). They are flown
          first; then it shows whether the vehicles are alike enough to build on what was learned there.
        </p>
      )}
    </div>
  );
}
