import { Box, SimpleGrid, TextInput } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { IconSearch } from "@tabler/icons-react";
import { useState } from "react";
import { useCampaign, useCampaigns, useTrials } from "../../api/queries";
import form from "../../ui/Form.module.css";
import { count, withUnit } from "../../ui/format";
import { gainsInBrackets } from "../../ui/gains";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { ShowMore } from "../../ui/ShowMore";
import { trialStateLabel, wasFlown } from "../../ui/states";
import { useUnits } from "../../ui/units";
import classes from "./Compare.module.css";
import { MOST_FLIGHTS } from "./chosenFlights";

interface Ticks {
  chosen: readonly number[];
  onToggle: (trial: number) => void;
}

/** Campaigns by name, with checkboxes for their flights; the one that the page was opened from first and expanded. */
export function FlightPicker({ from, ...ticks }: Ticks & { from: number | null }) {
  const [search, setSearch] = useState("");
  const [sought] = useDebouncedValue(search.trim(), 200);
  const campaigns = useCampaigns({ search: sought, state: [], vehicle: [], sort: "-updated" });
  const origin = useCampaign(from);
  const found = campaigns.data?.items ?? [];
  const flown = found.filter(({ flights, id }) => flights > 0 && id !== from);
  return (
    <Panel title="Select flights">
      <TextInput
        aria-label="Search campaigns by name"
        placeholder="Search campaigns"
        leftSection={<IconSearch size={18} aria-hidden />}
        value={search}
        onChange={(event) => setSearch(event.currentTarget.value)}
      />
      {ticks.chosen.length >= MOST_FLIGHTS && (
        <Note mt={10}>At most {MOST_FLIGHTS} flights can be compared at once.</Note>
      )}
      <ErrorNotice error={campaigns.error ?? origin.error} />
      {origin.data && sought === "" && (
        <Campaign
          id={origin.data.id}
          name={origin.data.name}
          flights={origin.data.trials.flown}
          experiment={origin.data.definition.experiment}
          open
          {...ticks}
        />
      )}
      {flown.map(({ id, name, experiment, flights }) => (
        <Campaign key={id} {...{ id, name, flights, experiment }} {...ticks} />
      ))}
      {campaigns.data && flown.length === 0 && from === null && (
        <Note mt={10}>
          {sought === "" ? "No flights yet. Fly a campaign first." : "No campaigns with flights match."}
        </Note>
      )}
      <ShowMore list={campaigns} mt={8}>
        Show more campaigns
      </ShowMore>
    </Panel>
  );
}

interface CampaignProps extends Ticks {
  id: number;
  name: string;
  flights: number;
  experiment: string;
  open?: boolean;
}

function Campaign({ name, flights, open = false, ...listed }: CampaignProps) {
  const [opened, setOpened] = useState(open);
  return (
    <details
      className={classes["campaign"]}
      open={opened}
      onToggle={({ currentTarget }) => setOpened(currentTarget.open)}
    >
      <summary>
        {name}
        <Box component="small" fw={550} ml="auto" pl={6}>
          {count(flights, "flight")}
        </Box>
      </summary>
      {opened && <Flights {...listed} />}
    </details>
  );
}

function Flights({
  id: campaignId,
  experiment,
  chosen,
  onToggle,
}: Pick<CampaignProps, "id" | "experiment" | keyof Ticks>) {
  const trials = useTrials(campaignId);
  const unit = useUnits(experiment).error;
  if (trials.data === undefined) return <ErrorNotice error={trials.error} />;
  return (
    <SimpleGrid component="ul" minColWidth="min(270px, 100%)" spacing={16} verticalSpacing={0}>
      {trials.data
        .filter(({ state }) => wasFlown(state))
        .map(({ id, number, state, error, gains }) => (
          <li key={id}>
            <label className={form["tick"]}>
              <input
                type="checkbox"
                checked={chosen.includes(id)}
                disabled={!chosen.includes(id) && chosen.length >= MOST_FLIGHTS}
                onChange={() => onToggle(id)}
              />
              <span>
                <strong>Flight {number}</strong>{" "}
                {error === null ? trialStateLabel(state).word.toLowerCase() : withUnit(error, unit)} <br />
                <small>{gainsInBrackets(gains)}</small>
              </span>
            </label>
          </li>
        ))}
    </SimpleGrid>
  );
}
