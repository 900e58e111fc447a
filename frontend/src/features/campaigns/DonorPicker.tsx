import { TextInput, UnstyledButton } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useState } from "react";
import { useCampaigns } from "../../api/queries";
import type { CampaignSummary } from "../../api/types";
import { GainList } from "../../ui/GainList";
import { plusMinus } from "../../ui/uncertainty";
import { useUnits } from "../../ui/useUnits";
import classes from "./DonorPicker.module.css";

interface Props {
  experiment: string;
  donor: CampaignSummary | null;
  error: string | undefined;
  onChange: (donor: CampaignSummary | null) => void;
}

const OFFERED = 6;

/** The campaign whose best gains are flown first; found by its name. */
export function DonorPicker({ experiment, donor, error, onChange }: Props) {
  const [search, setSearch] = useState(donor?.name ?? "");
  const [sought] = useDebouncedValue(search.trim(), 200);
  const found = useCampaigns({ search: sought, state: [], vehicle: [], sort: "-updated" });
  const usable = (found.data?.pages.flatMap((page) => page.items) ?? []).filter(
    (campaign) => campaign.best !== null && campaign.experiment === experiment,
  );
  const choose = (chosen: CampaignSummary): void => {
    setSearch(chosen.name);
    onChange(chosen);
  };
  return (
    <div className={classes["donor"]}>
      <TextInput
        label="Campaign"
        type="search"
        placeholder="Search by name"
        autoComplete="off"
        value={search}
        error={error}
        onChange={(event) => {
          setSearch(event.currentTarget.value);
          onChange(null);
        }}
        onKeyDown={(event) => {
          if (event.key !== "Enter" || donor !== null) return;
          event.preventDefault();
          if (usable[0] !== undefined && sought === search.trim()) choose(usable[0]);
        }}
      />
      {donor === null && found.data !== undefined && <Offers campaigns={usable} onChoose={choose} />}
      {donor?.best && <Taken donor={donor} best={donor.best} experiment={experiment} />}
    </div>
  );
}

interface OffersProps {
  campaigns: readonly CampaignSummary[];
  onChoose: (campaign: CampaignSummary) => void;
}

function Offers({ campaigns, onChoose }: OffersProps) {
  if (campaigns.length === 0)
    return <p role="status">No campaign of this experiment has a valid flight and such a name.</p>;
  return (
    <ul className={classes["offers"]} aria-label="Campaigns to start from">
      {campaigns.slice(0, OFFERED).map((campaign) => (
        <li key={campaign.id}>
          <UnstyledButton className={classes["offer"] ?? ""} onClick={() => onChoose(campaign)}>
            {campaign.name} · {campaign.vehicle.title}
          </UnstyledButton>
        </li>
      ))}
      {campaigns.length > OFFERED && <li className={classes["rest"]}>More: type more of the name.</li>}
    </ul>
  );
}

interface TakenProps {
  donor: CampaignSummary;
  best: NonNullable<CampaignSummary["best"]>;
  experiment: string;
}

function Taken({ donor, best, experiment }: TakenProps) {
  const unit = useUnits(experiment).error;
  return (
    <p className={`${classes["taken"]} numbers`}>
      Its best, flight {best.trial_number} on {donor.vehicle.title}:{" "}
      <strong>
        <GainList gains={best.gains} experiment={experiment} />
      </strong>
      , error {plusMinus(best.mean, best.standard_error, unit)}
      {best.standard_error === null ? "" : " (± standard error)"}. They are flown first; then it shows whether the
      vehicles are alike enough to build on what was learned there.
    </p>
  );
}
