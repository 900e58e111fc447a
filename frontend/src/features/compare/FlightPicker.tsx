import { Button, TextInput } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { IconSearch } from "@tabler/icons-react";
import { useState } from "react";
import { useCampaign, useCampaigns, useTrials } from "../../api/queries";
import { count, withUnit } from "../../ui/format";
import { gainsInBrackets } from "../../ui/gains";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { addPage } from "../../ui/paging";
import { trialStateLabel, wasFlown } from "../../ui/states";
import { useUnits } from "../../ui/units";
import classes from "./Compare.module.css";
import { MOST_FLIGHTS } from "./chosenFlights";

interface Props {
  chosen: readonly number[];
  onToggle: (trial: number) => void;
  /** The originating campaign, shown first and expanded. */
  from: number | null;
}

/** Campaigns by name, with checkboxes for their flights. */
export function FlightPicker({ chosen, onToggle, from }: Props) {
  const [search, setSearch] = useState("");
  const [sought] = useDebouncedValue(search.trim(), 200);
  const campaigns = useCampaigns({ search: sought, state: [], vehicle: [], sort: "-updated" });
  const found = campaigns.data?.pages.flatMap((page) => page.items) ?? [];
  const flown = found.filter(({ flights, id }) => flights > 0 && id !== from);
  const full = chosen.length >= MOST_FLIGHTS;
  return (
    <Panel title="Select flights">
      <TextInput
        aria-label="Search campaigns by name"
        placeholder="Search campaigns"
        leftSection={<IconSearch size={18} aria-hidden />}
        value={search}
        onChange={(event) => setSearch(event.currentTarget.value)}
      />
      {full && <Note mt={10}>At most {MOST_FLIGHTS} flights can be compared at once.</Note>}
      <ErrorNotice error={campaigns.error} />
      {from !== null && sought === "" && <From campaignId={from} chosen={chosen} onToggle={onToggle} />}
      {flown.map(({ id, name, experiment, flights }) => (
        <Campaign key={id} id={id} title={name} flights={flights} {...{ experiment, chosen, onToggle }} />
      ))}
      {campaigns.data && flown.length === 0 && from === null && (
        <Note mt={10}>
          {sought === "" ? "No flights yet. Fly a campaign first." : "No campaigns with flights match."}
        </Note>
      )}
      {campaigns.hasNextPage && (
        <Button variant="default" mt={8} loading={campaigns.isFetchingNextPage} onClick={() => void addPage(campaigns)}>
          Show more campaigns
        </Button>
      )}
    </Panel>
  );
}

interface Ticks {
  chosen: readonly number[];
  onToggle: (trial: number) => void;
}

function From({ campaignId, ...ticks }: Ticks & { campaignId: number }) {
  const campaign = useCampaign(campaignId);
  if (campaign.data === undefined) return <ErrorNotice error={campaign.error} />;
  const { name, definition, trials } = campaign.data;
  return (
    <Campaign
      id={campaignId}
      title={name}
      flights={trials.flown}
      experiment={definition.experiment ?? "takeoff"}
      open
      {...ticks}
    />
  );
}

interface CampaignProps extends Ticks {
  id: number;
  title: string;
  flights: number;
  experiment: string;
  open?: boolean;
}

function Campaign({ id, title, flights, experiment, open = false, chosen, onToggle }: CampaignProps) {
  const [opened, setOpened] = useState(open);
  return (
    <details
      className={classes["campaign"]}
      open={opened}
      onToggle={(event) => setOpened((event.currentTarget as HTMLDetailsElement).open)}
    >
      <summary>
        <span>{title}</span> <small className={classes["dim"]}>{count(flights, "flight")}</small>
      </summary>
      {opened && <Flights campaignId={id} {...{ experiment, chosen, onToggle }} />}
    </details>
  );
}

function Flights({ campaignId, experiment, chosen, onToggle }: Ticks & { campaignId: number; experiment: string }) {
  const trials = useTrials(campaignId);
  const unit = useUnits(experiment).error;
  if (trials.data === undefined) return <ErrorNotice error={trials.error} />;
  return (
    <ul className={`${classes["flights"]} numbers`}>
      {trials.data
        .filter(({ state }) => wasFlown(state))
        .map(({ id, number, state, error, gains }) => (
          <li key={id}>
            <label>
              <input
                type="checkbox"
                checked={chosen.includes(id)}
                disabled={!chosen.includes(id) && chosen.length >= MOST_FLIGHTS}
                onChange={() => onToggle(id)}
              />
              <span>
                <strong>Flight {number}</strong>{" "}
                {error === null ? trialStateLabel(state).word.toLowerCase() : withUnit(error, unit)}{" "}
                <small className={classes["dim"]}>{gainsInBrackets(gains)}</small>
              </span>
            </label>
          </li>
        ))}
    </ul>
  );
}
