import { Anchor, SegmentedControl, Skeleton, useComputedColorScheme } from "@mantine/core";
import { useCallback, useEffect, useState } from "react";
import { Link, useParams } from "react-router";
import { useCampaign, useCampaignFigure, useCurveOf, useProposal, useTrials } from "../api/queries";
import type { Campaign, Trial } from "../api/types";
import { CampaignHeader } from "../components/CampaignHeader";
import { FigurePanel } from "../components/FigurePanel";
import { LandscapePanel } from "../components/LandscapePanel";
import { Missing } from "../components/Missing";
import { NextFlightCard } from "../components/NextFlightCard";
import { Panel } from "../components/Panel";
import { loadPlotly } from "../components/plotly";
import { StatisticsPanel } from "../components/StatisticsPanel";
import { TrialsTable } from "../components/TrialsTable";
import { Trouble } from "../components/Trouble";
import { useTitle } from "../components/useTitle";
import { useUnits } from "../components/useUnits";
import { VerdictPanel } from "../components/VerdictPanel";
import { pointAt } from "../lib/pointing";
import { type PlotlyFigure, type Seconds, withChosen, withTimeRange } from "../lib/traces";
import { shownTrial } from "../lib/verdict";
import classes from "./CampaignPage.module.css";
import { NotFoundPage } from "./NotFoundPage";

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
  if (campaign.error) return <Missing error={campaign.error} />;
  return <Coming campaignId={campaignId} />;
}

/** What the page will want is asked for at once, not only when there is a place for it. */
function Coming({ campaignId }: { campaignId: number }) {
  const theme = useComputedColorScheme("light");
  useProposal(campaignId);
  useCampaignFigure(campaignId, "takeoffs", theme);
  useCampaignFigure(campaignId, "errors", theme);
  useCampaignFigure(campaignId, "gains", theme);
  useEffect(() => {
    loadPlotly().catch(() => undefined); // the chart asks again, and says what is wrong
  }, []);
  return (
    <div aria-busy="true" className={classes["columns"]}>
      <Skeleton height={480} radius="md" />
      <Skeleton height={480} radius="md" />
    </div>
  );
}

/** Height of the lower charts: enough for a panel of each gain. */
const LOWER_PX = 300;
const PANEL_PX = 84;
const FIRST_SECONDS = [-0.3, 8] as const;
const NONE: readonly Trial[] = [];
/** Of more flights the server gives an envelope, and a flight's own curve when it is asked for. */
const EACH_DRAWN = 30;

function useDressed(chosen: number | null, span: string): (figure: PlotlyFigure) => PlotlyFigure {
  return useCallback(
    (figure) => ({
      data: withChosen(figure.data, chosen),
      layout: withTimeRange(figure.layout, span === "first" ? FIRST_SECONDS : null),
    }),
    [chosen, span],
  );
}

interface View {
  campaign: Campaign;
  /** Null while they are read: of a thousand flights the charts need not wait for them. */
  trials: readonly Trial[] | null;
  trouble: unknown;
}

function CampaignView({ campaign, trials: read, trouble }: View) {
  const trials = read ?? NONE;
  const theme = useComputedColorScheme("light");
  const [chosen, setChosen] = useState<number | null>(null);
  const [span, setSpan] = useState("whole");
  const [zoom, setZoom] = useState<Seconds | null>(null);
  const next = useProposal(campaign.id);
  const takeoffs = useCampaignFigure(campaign.id, "takeoffs", theme, {
    window: zoom ?? (span === "first" ? FIRST_SECONDS : null),
    flight: campaign.trials.flown > EACH_DRAWN ? chosen : null,
  });
  const errors = useCampaignFigure(campaign.id, "errors", theme);
  const gains = useCampaignFigure(campaign.id, "gains", theme);
  const experiment = campaign.definition.experiment ?? "takeoff";
  const unit = useUnits(experiment).error;
  const curveOf = useCurveOf(trials, experiment);
  const lower = Math.max(LOWER_PX, PANEL_PX * ((gains.data?.table?.columns.length ?? 1) - 1));
  const shown = shownTrial(trials, chosen);
  const choose = useCallback((number: number) => setChosen((before) => (before === number ? null : number)), []);
  useEffect(() => () => pointAt(null), []);
  return (
    <>
      <p className="visually-hidden" role="status">
        {campaign.flying ? `Flight ${campaign.flying.trial_number} is under way.` : (trials.at(-1)?.verdict ?? "")}
      </p>
      <CampaignHeader campaign={campaign} />
      <div className={classes["columns"]} data-flying={campaign.flying !== null || undefined}>
        <div className={classes["flown"]}>
          <FigurePanel
            title={takeoffs.data?.title ?? "Curves"}
            card={takeoffs.data}
            error={takeoffs.error}
            height={440}
            topic="curves"
            dressed={useDressed(chosen, span)}
            liveTrial={campaign.flying?.trial_id ?? null}
            onChoose={choose}
            onWindow={setZoom}
            curveOf={curveOf}
            tools={
              <SegmentedControl
                aria-label="Time shown"
                size="sm"
                value={span}
                onChange={(value) => {
                  setSpan(value);
                  setZoom(null);
                }}
                data={[
                  { value: "first", label: "First 8 s" },
                  { value: "whole", label: "Whole flight" },
                ]}
              />
            }
          />
          {shown !== null && (
            <VerdictPanel
              trial={shown}
              trials={trials}
              isBest={shown.id === campaign.best?.trial_id}
              unit={unit}
              experiment={experiment}
            />
          )}
        </div>
        <div className={classes["next"]}>
          {read === null && trouble === null && <Skeleton height={480} radius="md" />}
          {next.data && read !== null ? (
            <NextFlightCard campaign={campaign} next={next.data} trials={trials} onChoose={setChosen} />
          ) : (
            <Trouble error={next.error ?? trouble} />
          )}
        </div>
      </div>
      <div className={classes["halves"]}>
        <FigurePanel
          title="Error per flight"
          card={errors.data}
          error={errors.error}
          height={lower}
          topic="threshold"
          onChoose={choose}
        />
        <FigurePanel title="Gains per flight" card={gains.data} error={gains.error} height={lower} onChoose={choose} />
      </div>
      <LandscapePanel campaignId={campaign.id} />
      <div className={classes["row"]}>{read !== null && <StatisticsPanel campaignId={campaign.id} />}</div>
      <Panel
        title="All flights"
        className={classes["row"]}
        tools={
          trials.length > 0 && (
            <Anchor component={Link} to={`/compare?campaign=${campaign.id}`} py={12}>
              Compare flights
            </Anchor>
          )
        }
      >
        {read === null ? (
          <Skeleton height={320} radius="md" />
        ) : trials.length === 0 ? (
          <p className={classes["none"]}>
            Nothing has flown yet. The first flight will stand here with its gains and error.
          </p>
        ) : (
          <TrialsTable
            campaign={campaign}
            trials={trials}
            shown={shown?.number ?? null}
            unit={unit}
            onChoose={choose}
          />
        )}
      </Panel>
    </>
  );
}
