import { Button, Group, SegmentedControl, SimpleGrid, Skeleton, TextInput, Title } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { IconPlus, IconSearch } from "@tabler/icons-react";
import { useState } from "react";
import { Link } from "wouter";
import { useCampaigns, useCatalogue } from "../../api/queries";
import type { Sort } from "../../api/types";
import { SelectField } from "../../ui/Fields";
import { ErrorNotice } from "../../ui/Notices";
import work from "../../ui/Page.module.css";
import { ShowMore } from "../../ui/ShowMore";
import { useTitle } from "../../ui/useTitle";
import { ChooseLog, Progress } from "../log-analysis/ChooseLog";
import { useAnalysis } from "../log-analysis/useAnalysis";
import { choicesOf } from "../new-campaign/newCampaign";
import { CampaignCard } from "./CampaignCard";
import classes from "./CampaignListPage.module.css";
import { STATES, type StateFilter } from "./campaignList";
import { FirstCampaign } from "./FirstCampaign";
import { ImportBundle } from "./ImportBundle";

const SORTS: { value: Sort; label: string }[] = [
  { value: "-updated", label: "Recently updated" },
  { value: "-created", label: "Newest" },
  { value: "created", label: "Oldest" },
  { value: "name", label: "Name" },
  { value: "error", label: "Lowest error" },
];

const CARDS = { minColWidth: "min(300px, 100%)", spacing: "var(--gap)" };

export function CampaignListPage() {
  useTitle("Campaigns");
  const [search, setSearch] = useState("");
  const [state, setState] = useState<StateFilter>("All");
  const [vehicle, setVehicle] = useState("");
  const [sort, setSort] = useState<Sort>("-updated");
  const [sought] = useDebouncedValue(search.trim(), 200);
  const analysis = useAnalysis();
  const kinds = useCatalogue().data?.vehicle_kinds ?? [];
  const filtered = sought !== "" || state !== "All" || vehicle !== "";
  const campaigns = useCampaigns({ search: sought, state: STATES[state], vehicle: vehicle ? [vehicle] : [], sort });
  const found = campaigns.data?.items ?? [];
  if (campaigns.data?.total === 0 && !filtered) return <FirstCampaign analysis={analysis} />;
  return (
    <>
      <Group gap={12} mb={14}>
        <Title order={1} me="auto">
          Campaigns
        </Title>
        <Button component={Link} to="/new" leftSection={<IconPlus size={20} aria-hidden />}>
          New campaign
        </Button>
        <ChooseLog analysis={analysis}>Analyse log</ChooseLog>
        <ImportBundle />
      </Group>
      <Progress analysis={analysis} />
      <Group component="search" gap={10} mb={18} className={classes["filters"]}>
        <TextInput
          flex="1 1 160px"
          aria-label="Search campaigns by name"
          placeholder="Search"
          leftSection={<IconSearch size={18} aria-hidden />}
          value={search}
          onChange={(event) => setSearch(event.currentTarget.value)}
        />
        <SegmentedControl
          aria-label="State"
          size="md"
          value={state}
          onChange={setState}
          data={Object.keys(STATES) as StateFilter[]}
        />
        <SelectField
          flex="9 1 150px"
          maw={200}
          aria-label="Vehicle"
          data={[{ value: "", label: "All vehicles" }, ...choicesOf(kinds)]}
          value={vehicle}
          onChange={setVehicle}
        />
        <SelectField flex="9 1 150px" maw={200} aria-label="Sort by" data={SORTS} value={sort} onChange={setSort} />
      </Group>
      <ErrorNotice error={campaigns.error} />
      {campaigns.isPending && (
        <SimpleGrid {...CARDS} aria-busy="true">
          {[1, 2, 3].map((one) => (
            <Skeleton key={one} height={250} radius="md" />
          ))}
        </SimpleGrid>
      )}
      {campaigns.data && found.length === 0 && (
        <div className={work["none"]}>
          <p>No campaigns match.</p>
          {filtered && (
            <Button
              variant="default"
              onClick={() => {
                setSearch("");
                setState("All");
                setVehicle("");
              }}
            >
              Show all campaigns
            </Button>
          )}
        </div>
      )}
      <SimpleGrid component="ul" {...CARDS} aria-label="Campaigns">
        {found.map((campaign) => (
          <CampaignCard key={campaign.id} campaign={campaign} />
        ))}
      </SimpleGrid>
      <ShowMore list={campaigns} mt={20} mx="auto" display="block" />
    </>
  );
}
