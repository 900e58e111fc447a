import { Button, Stack, Text, TextInput } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { type ReactNode, useState } from "react";
import { useCampaigns } from "../../api/queries";
import type { CampaignSummary } from "../../api/types";
import { Aside } from "../../ui/Aside";
import { GainList } from "../../ui/gains";
import { plusMinus } from "../../ui/uncertainty";
import { useUnits } from "../../ui/units";

interface Props {
  experiment: string;
  label: ReactNode;
  value?: CampaignSummary | null;
  error: ReactNode;
  onChange: (donor: CampaignSummary | null) => void;
}

const OFFERED = 6;

/** Search for the campaign whose best gains are flown first. */
export function DonorPicker({ experiment, label, value: donor = null, error, onChange }: Props) {
  const [search, setSearch] = useState(donor?.name ?? "");
  const [sought] = useDebouncedValue(search.trim(), 200);
  const found = useCampaigns({ search: sought, state: [], vehicle: [], sort: "-updated" });
  const unit = useUnits(experiment).error;
  const usable = (found.data?.items ?? []).filter(
    (campaign) => campaign.best !== null && campaign.experiment === experiment,
  );
  const choose = (chosen: CampaignSummary): void => {
    setSearch(chosen.name);
    onChange(chosen);
  };
  return (
    <Stack gap={8}>
      <TextInput
        label={label}
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
      {donor === null && found.data !== undefined && usable.length === 0 && (
        <p role="status">
          {sought === "" && !found.hasNextPage
            ? "No campaign of this experiment has a valid flight yet."
            : "No campaigns match. Only campaigns of this experiment with a valid flight are listed."}
        </p>
      )}
      {donor === null && usable.length > 0 && (
        <Stack
          component="ul"
          gap={0}
          p={4}
          bd="1px solid var(--hairline)"
          bdrs="md"
          bg="var(--surface)"
          aria-label="Campaigns to start from"
        >
          {usable.slice(0, OFFERED).map((campaign) => (
            <li key={campaign.id}>
              <Button variant="subtle" c="inherit" fw={400} fullWidth justify="start" onClick={() => choose(campaign)}>
                {campaign.name} · {campaign.vehicle.title}
              </Button>
            </li>
          ))}
          {usable.length > OFFERED && (
            <Text component="li" c="dimmed" fz="small" p="8px 12px">
              Keep typing to narrow the list.
            </Text>
          )}
        </Stack>
      )}
      {donor?.best && (
        <Aside tone="good" fz="small">
          Best: flight {donor.best.trial_number} on {donor.vehicle.title}:{" "}
          <strong>
            <GainList gains={donor.best.gains} experiment={experiment} />
          </strong>
          , error {plusMinus(donor.best.mean, donor.best.standard_error, unit)}
          {donor.best.standard_error === null ? "" : " (± standard error)"}. The first flight uses these gains and shows
          whether the vehicles are similar enough to build on that campaign's results.
        </Aside>
      )}
    </Stack>
  );
}
