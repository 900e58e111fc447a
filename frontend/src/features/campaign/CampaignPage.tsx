import { SimpleGrid, Skeleton, Tabs, useComputedColorScheme } from "@mantine/core";
import { memo, startTransition, useCallback, useEffect, useRef, useState } from "react";
import { flushSync } from "react-dom";
import { useParams } from "react-router";
import { useReadOnlyReason } from "../../api/access";
import { useCampaign, useCampaignFigure, useCatalogue, useProposal, useTrials } from "../../api/queries";
import type { Campaign, Trial } from "../../api/types";
import { loadPlotly } from "../../charts/plotly";
import { pointAt } from "../../charts/pointing";
import { NotFound, NotFoundPage } from "../../ui/NotFound";
import { ErrorNotice, ReadOnlyNotice } from "../../ui/Notices";
import { useUnits } from "../../ui/units";
import { useTitle } from "../../ui/useTitle";
import { ByFlightPanels, CurvesPanel, LandscapePanel } from "./CampaignCharts";
import { CampaignHeader } from "./CampaignHeader";
import classes from "./CampaignPage.module.css";
import { FlightsPanel } from "./flights/FlightsPanel";
import { useFlightKeys } from "./flights/useFlightKeys";
import { useSelectedFlights } from "./flights/useSelectedFlights";
import { NextFlightCard } from "./next-flight/NextFlightCard";
import type { Preview } from "./proposal/useChosenFlight";
import { StatisticsPanel } from "./statistics/StatisticsPanel";
import { useCampaignStatus } from "./useCampaignStatus";
import { useTab } from "./useTab";
import { VerdictPanel } from "./verdict/VerdictPanel";
import { shownTrial } from "./verdict/verdict";

export function CampaignPage() {
  const campaignId = Number(useParams()["campaignId"]);
  return Number.isInteger(campaignId) ? <CampaignById key={campaignId} campaignId={campaignId} /> : <NotFoundPage />;
}

function CampaignById({ campaignId }: { campaignId: number }) {
  const campaign = useCampaign(campaignId);
  const trials = useTrials(campaignId);
  useTitle(campaign.data?.name ?? "Campaign");
  if (campaign.data) {
    return <CampaignView campaign={campaign.data} trials={trials.data ?? null} trouble={trials.error} />;
  }
  if (campaign.error) return <NotFound error={campaign.error} />;
  return <Coming campaignId={campaignId} />;
}

/** Loading state. Requests all data of the page in parallel. */
function Coming({ campaignId }: { campaignId: number }) {
  const theme = useComputedColorScheme("light");
  useCatalogue();
  useProposal(campaignId);
  useCampaignFigure(campaignId, "takeoffs", theme);
  useCampaignFigure(campaignId, "errors", theme);
  useCampaignFigure(campaignId, "gains", theme);
  useEffect(() => {
    loadPlotly().catch(() => undefined); // the chart loads it again and reports the error
  }, []);
  return (
    <div aria-busy="true" className={classes["columns"]}>
      <Skeleton height={480} radius="md" />
      <Skeleton height={480} radius="md" />
    </div>
  );
}

const NONE: readonly Trial[] = [];
const Verdict = memo(VerdictPanel);
const Next = memo(NextFlightCard);
const Statistics = memo(StatisticsPanel);
const Landscape = memo(LandscapePanel);

interface View {
  campaign: Campaign;
  /** Null while loading; the charts do not wait for them. */
  trials: readonly Trial[] | null;
  trouble: unknown;
}

function CampaignView({ campaign, trials: read, trouble }: View) {
  const trials = read ?? NONE;
  const [chosen, setChosen] = useState<number | null>(null);
  const [preview, setPreview] = useState<Preview | null>(null);
  const [tab, openTab] = useTab();
  const standing = useCampaignStatus(campaign.id);
  const unproposed = useProposal(campaign.id).error;
  const experiment = campaign.definition.experiment ?? "takeoff";
  const unit = useUnits(experiment).error;
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
    <>
      <p className="visually-hidden" role="status">
        {campaign.flying ? `Flight ${campaign.flying.trial_number} is in progress.` : (trials.at(-1)?.verdict ?? "")}
      </p>
      <CampaignHeader campaign={campaign} />
      <ReadOnlyNotice why={watching} />
      <div className={classes["columns"]} data-flying={campaign.flying !== null || undefined}>
        <div className={classes["column"]} ref={results}>
          <CurvesPanel campaign={campaign} trials={trials} chosen={chosen} preview={preview} onChoose={choose} />
          {shown !== null && (
            <Verdict
              trial={shown}
              trials={trials}
              isBest={shown.id === campaign.best?.trial_id}
              unit={unit}
              experiment={experiment}
            />
          )}
        </div>
        <div className={`${classes["column"]} ${classes["next"]}`}>
          {standing !== null && <Next {...standing} onChoose={show} onPreview={setPreview} onReview={review} />}
          {standing === null &&
            (unproposed || trouble ? (
              <ErrorNotice error={unproposed ?? trouble} />
            ) : (
              <Skeleton height={480} radius="md" />
            ))}
        </div>
      </div>
      <Tabs
        value={tab}
        onChange={openTab}
        mt="var(--gap)"
        keepMounted={false}
        classNames={{ tab: classes["tab"] ?? "" }}
      >
        <Tabs.List>
          <Tabs.Tab value="trends">Error and gains</Tabs.Tab>
          <Tabs.Tab value="flights">
            Flights{selection.selected.length > 0 && ` (${selection.selected.length} selected)`}
          </Tabs.Tab>
          <Tabs.Tab value="statistics">Statistics</Tabs.Tab>
          <Tabs.Tab value="landscape">Error landscape</Tabs.Tab>
        </Tabs.List>
        <Tabs.Panel value="trends" pt="var(--gap)">
          <SimpleGrid cols={{ base: 1, sm: 2 }} spacing="var(--gap)">
            <ByFlightPanels campaignId={campaign.id} preview={preview} onChoose={choose} />
          </SimpleGrid>
        </Tabs.Panel>
        <Tabs.Panel value="flights" keepMounted pt="var(--gap)">
          <FlightsPanel
            campaign={campaign}
            trials={read}
            shown={shown?.number ?? null}
            unit={unit}
            onChoose={choose}
            {...selection}
          />
        </Tabs.Panel>
        <Tabs.Panel value="statistics" pt="var(--gap)">
          {read !== null && <Statistics campaignId={campaign.id} />}
        </Tabs.Panel>
        <Tabs.Panel value="landscape">
          <Landscape campaignId={campaign.id} />
        </Tabs.Panel>
      </Tabs>
    </>
  );
}
