import { Group, SimpleGrid, Skeleton, Tabs } from "@mantine/core";
import { memo, startTransition, useCallback, useEffect, useRef, useState } from "react";
import { flushSync } from "react-dom";
import { useParams, useSearchParams } from "wouter";
import { useReadOnlyReason } from "../../api/access";
import { useCampaign, useCampaignFigure, useCatalogue, useProposal, useTrials } from "../../api/queries";
import type { Campaign, Trial } from "../../api/types";
import { loadPlotly } from "../../charts/plotly";
import { pointAt } from "../../charts/pointing";
import { NotFound, NotFoundPage } from "../../ui/NotFound";
import { ErrorNotice, ReadOnlyNotice } from "../../ui/Notices";
import { useUnits } from "../../ui/units";
import { useTitle } from "../../ui/useTitle";
import { ByFlightPanels, CurvesPanel } from "./CampaignCharts";
import { CampaignHeader } from "./CampaignHeader";
import classes from "./CampaignPage.module.css";
import { FlightsPanel } from "./flights/FlightsPanel";
import { useFlightKeys } from "./flights/useFlightKeys";
import { useSelectedFlights } from "./flights/useSelectedFlights";
import { NextFlightCard } from "./next-flight/NextFlightCard";
import type { Preview } from "./proposal/useChosenFlight";
import { StatisticsPanel } from "./statistics/StatisticsPanel";
import { useCampaignStatus } from "./useCampaignStatus";
import { VerdictPanel } from "./verdict/VerdictPanel";
import { shownTrial } from "./verdict/verdict";

export function CampaignPage() {
  const campaignId = Number(useParams()["campaignId"]);
  return Number.isInteger(campaignId) ? <CampaignById key={campaignId} campaignId={campaignId} /> : <NotFoundPage />;
}

function CampaignById({ campaignId }: { campaignId: number }) {
  const { data: campaign, error } = useCampaign(campaignId);
  useTitle(campaign?.name ?? "Campaign");
  if (campaign) return <CampaignView campaign={campaign} />;
  return error ? <NotFound error={error} /> : <Coming campaignId={campaignId} />;
}

/** The two columns of the page. */
const SIDE_BY_SIDE = { className: classes["columns"], align: "stretch", gap: "var(--gap)" };

/** Loading state. Requests all data of the page in parallel. */
function Coming({ campaignId }: { campaignId: number }) {
  useCatalogue();
  useTrials(campaignId);
  useProposal(campaignId);
  useCampaignFigure(campaignId, "takeoffs");
  useCampaignFigure(campaignId, "errors");
  useCampaignFigure(campaignId, "gains");
  useEffect(() => {
    loadPlotly().catch(() => undefined); // the chart loads it again and reports the error
  }, []);
  return (
    <div className={classes["page"]}>
      <Group aria-busy="true" {...SIDE_BY_SIDE}>
        <Skeleton height={480} radius="md" className={classes["results"]} />
        <Skeleton height={480} radius="md" className={classes["action"]} />
      </Group>
    </div>
  );
}

const TABS = ["trends", "flights", "statistics"] as const;

/** The open tab of a campaign's page, kept in the address so that going back and reloading show it again; the first for
 * an address that names none of them. */
function useTab(): [string, (tab: string | null) => void] {
  const [params, setParams] = useSearchParams();
  const tab = TABS.find((one) => one === params.get("tab")) ?? TABS[0];
  const open = (value: string | null): void =>
    setParams(
      (before) => {
        const after = new URLSearchParams(before);
        if (value === null || value === TABS[0]) after.delete("tab");
        else after.set("tab", value);
        return after;
      },
      { replace: true },
    );
  return [tab, open];
}

const NONE: readonly Trial[] = [];
const Verdict = memo(VerdictPanel);
const Next = memo(NextFlightCard);
const Statistics = memo(StatisticsPanel);

function CampaignView({ campaign }: { campaign: Campaign }) {
  // Undefined while loading; the charts do not wait for them.
  const { data: read, error: trouble } = useTrials(campaign.id);
  const trials = read ?? NONE;
  const [chosen, setChosen] = useState<number | null>(null);
  const [preview, setPreview] = useState<Preview | null>(null);
  const [tab, openTab] = useTab();
  const standing = useCampaignStatus(campaign.id);
  const problem = useProposal(campaign.id).error ?? trouble;
  const unit = useUnits(campaign.definition.experiment).error;
  const shown = shownTrial(trials, chosen, standing?.campaign ?? campaign);
  const watching = useReadOnlyReason(campaign.vehicle);
  const choose = useCallback(
    (number: number) => startTransition(() => setChosen((before) => (before === number ? null : number))),
    [],
  );
  const results = useRef<HTMLDivElement>(null);
  const review = useCallback((number: number) => {
    flushSync(() => setChosen(number));
    const button = results.current?.querySelector<HTMLElement>("[data-review] button");
    button?.scrollIntoView({ block: "center" });
    button?.focus({ preventScroll: true });
  }, []);
  const show = useCallback((number: number) => {
    flushSync(() => setChosen(number));
    results.current?.lastElementChild?.scrollIntoView({ block: "nearest" });
  }, []);
  const selection = useSelectedFlights(campaign.id, shown);
  useFlightKeys(trials, shown?.id, ({ number }) => choose(number));
  useEffect(() => () => pointAt(null), []);
  const { flown } = campaign.trials;
  const flownBefore = useRef(flown);
  useEffect(() => {
    if (flown > flownBefore.current) setChosen(null); // the result of the flight that has landed is shown
    flownBefore.current = flown;
  }, [flown]);
  return (
    <div className={classes["page"]}>
      <p className="visually-hidden" role="status">
        {campaign.flying ? `Flight ${campaign.flying.trial_number} is in progress.` : (trials.at(-1)?.verdict ?? "")}
      </p>
      <CampaignHeader campaign={campaign} />
      <ReadOnlyNotice why={watching} />
      {/* On narrow screens the action comes first, but a flight under way is watched. */}
      <Group wrap={campaign.flying === null ? "wrap-reverse" : "wrap"} {...SIDE_BY_SIDE}>
        <div className={classes["results"]} ref={results}>
          <CurvesPanel campaign={campaign} trials={trials} chosen={chosen} preview={preview} onChoose={choose} />
          {shown !== null && <Verdict trial={shown} trials={trials} />}
        </div>
        <div className={classes["action"]}>
          {standing !== null && <Next {...standing} onChoose={show} onPreview={setPreview} onReview={review} />}
          {standing === null && !problem && <Skeleton height={480} radius="md" />}
          {standing === null && <ErrorNotice error={problem} />}
        </div>
      </Group>
      <Tabs value={tab} onChange={openTab} mt="var(--gap)" keepMounted={false} classNames={{ tab: classes["tab"] }}>
        <Tabs.List>
          <Tabs.Tab value="trends">Error and gains</Tabs.Tab>
          <Tabs.Tab value="flights">
            Flights{selection.selected.length > 0 && ` (${selection.selected.length} selected)`}
          </Tabs.Tab>
          <Tabs.Tab value="statistics">Statistics</Tabs.Tab>
        </Tabs.List>
        <Tabs.Panel value="trends" pt="var(--gap)">
          <SimpleGrid cols={{ base: 1, sm: 2 }} spacing="var(--gap)">
            <ByFlightPanels campaignId={campaign.id} preview={preview} onChoose={choose} />
          </SimpleGrid>
        </Tabs.Panel>
        <Tabs.Panel value="flights" keepMounted pt="var(--gap)">
          <FlightsPanel
            campaign={campaign}
            trials={read ?? null}
            shown={shown?.number ?? null}
            unit={unit}
            onChoose={choose}
            {...selection}
          />
        </Tabs.Panel>
        <Tabs.Panel value="statistics" pt="var(--gap)">
          {read && <Statistics campaignId={campaign.id} />}
        </Tabs.Panel>
      </Tabs>
    </div>
  );
}
