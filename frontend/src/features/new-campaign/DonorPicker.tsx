import { Stack, TextInput, UnstyledButton } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useState } from "react";
import { useCampaigns } from "../../api/queries";
import type { CampaignSummary } from "../../api/types";
import { Aside } from "../../ui/Aside";
import { GainList } from "../../ui/gains";
import { plusMinus } from "../../ui/uncertainty";
import { useUnits } from "../../ui/units";
import classes from "./NewCampaign.module.css";

interface Props {
  experiment: string;
  donor: CampaignSummary | null;
  error: string | undefined;
  onChange: (donor: CampaignSummary | null) => void;
}

const OFFERED = 6;

/** Search for the campaign whose best gains are flown first. */
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
    <Stack gap={8}>
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
      {donor === null && found.data !== undefined && (
        <Offers campaigns={usable} isAll={sought === "" && !found.hasNextPage} onChoose={choose} />
      )}
      {donor?.best && <Taken donor={donor} best={donor.best} experiment={experiment} />}
    </Stack>
  );
}

interface OffersProps {
  campaigns: readonly CampaignSummary[];
  /** Whether these are all that there are. */
  isAll: boolean;
  onChoose: (campaign: CampaignSummary) => void;
}

function Offers({ campaigns, isAll, onChoose }: OffersProps) {
  if (campaigns.length === 0) {
    return (
      <p role="status">
        {isAll
          ? "No campaign of this experiment has a valid flight yet."
          : "No campaigns match. Only campaigns of this experiment with a valid flight are listed."}
      </p>
    );
  }
  return (
    <ul className={classes["offers"]} aria-label="Campaigns to start from">
      {campaigns.slice(0, OFFERED).map((campaign) => (
        <li key={campaign.id}>
          <UnstyledButton className={classes["offer"] ?? ""} onClick={() => onChoose(campaign)}>
            {campaign.name} · {campaign.vehicle.title}
          </UnstyledButton>
        </li>
      ))}
      {campaigns.length > OFFERED && <li className={classes["rest"]}>Keep typing to narrow the list.</li>}
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
    <Aside tone="good" fz="small" className="numbers">
      Best: flight {best.trial_number} on {donor.vehicle.title}:{" "}
      <strong>
        <GainList gains={best.gains} experiment={experiment} />
      </strong>
      , error {plusMinus(best.mean, best.standard_error, unit)}
      {best.standard_error === null ? "" : " (± standard error)"}. The first flight uses these gains and shows whether
      the vehicles are similar enough to build on that campaign's results.
    </Aside>
  );
}
